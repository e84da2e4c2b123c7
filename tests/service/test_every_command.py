"""What holds for every command, also for those that are still to come."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import typer

from service.cli.app import app


def commands(command: Any, name: tuple[str, ...] = ()) -> Iterator[tuple[str, set[str]]]:
    """Each command below this one, with its options."""
    if inner := getattr(command, "commands", None):
        for word, sub in inner.items():
            yield from commands(sub, (*name, word))
    else:
        yield " ".join(name), {option for parameter in command.params for option in parameter.opts}


EVERY = dict(commands(typer.main.get_command(app)))


def test_commands_of_groups_are_among_them() -> None:
    assert {"up", "status", "identify links", "model diff"} <= set(EVERY)


@pytest.mark.parametrize("name", EVERY)
def test_its_answer_can_be_had_as_json_and_its_arm_be_named(name: str) -> None:
    assert {"--json", "--arm"} <= EVERY[name]
