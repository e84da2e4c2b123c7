"""How a command can end, and the exit code of each ending."""

from __future__ import annotations

DONE = 0
ANSWER_IS_NO = 1
BAD_INPUT = 2
"""`config.InputError`, and wrong usage: named precisely, nothing moved, nothing lost."""
ARM_STOPPED = 3
NO_DAEMON = 4
DEFECT = 70
"""An error of Étude's own (EX_SOFTWARE of sysexits.h); the only ending that shows a traceback."""
INTERRUPTED = 130


class ArmStopped(Exception):
    """The arm came to rest before the work was done. The message is the cause, one sentence."""


class NoDaemon(Exception):
    """No daemon answers for the arm. The message says where it was looked for, and how to start one."""
