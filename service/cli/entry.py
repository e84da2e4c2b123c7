"""From arguments to an exit code: every ending of a command is decided here."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence

import typer

from config import InputError
from service import outcomes
from service.cli.app import app
from service.cli.console import say


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns its exit code (`service.outcomes`). Errors are one sentence on standard error."""
    try:
        code = app(list(arguments), prog_name="etude", standalone_mode=False)
    except typer.Abort:
        return outcomes.INTERRUPTED
    except typer.TyperException as error:
        say(f"etude: {error.format_message()}; see etude --help")
        return outcomes.BAD_INPUT
    except InputError as error:
        say(f"etude: {error}")
        return outcomes.BAD_INPUT
    except outcomes.ArmStopped as error:
        say(f"etude: the arm stopped: {error}")
        return outcomes.ARM_STOPPED
    except outcomes.NoDaemon as error:
        say(f"etude: {error}")
        return outcomes.NO_DAEMON
    except BrokenPipeError:
        # The reader of our output has seen enough (etude recordings | head); Python must not try to flush again.
        sys.stdout = None
        return outcomes.DONE
    except Exception as error:
        traceback.print_exc()
        say(f"etude: a defect of Étude's own, not of your input: {type(error).__name__}: {error}")
        return outcomes.DEFECT
    return code if isinstance(code, int) else outcomes.DONE
