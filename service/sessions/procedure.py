"""What every kind of session has in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from service.sessions.moving import MovingArm
from service.sessions.store import Kind, Session

Tell = Callable[[str, float], None]
"""Takes the stage in words and the share of the whole session that is done."""


def within(tell: Tell, stage: str, begin: float, end: float) -> Callable[[float], None]:
    """Progress of one part of a session, told as the session's between ``begin`` and ``end``."""
    return lambda share: tell(stage, begin + share * (end - begin))


def part(tell: Tell, begin: float, end: float) -> Tell:
    """Stages and progress of one part of a session, told as the session's between ``begin`` and ``end``."""
    return lambda stage, share: tell(stage, begin + share * (end - begin))


class Procedure(Protocol):
    """One session's work, checked as a whole when it is made: making it raises InputError, and nothing has moved."""

    kind: Kind

    def arguments(self) -> dict[str, Any]:
        """What was asked, for the record."""
        ...

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        """Do it, keep what comes of it in the session's directory, and return the answer.

        Raises ArmStopped when the arm stopped before the work was done. The conductor disables the drives after it.
        """
        ...
