"""What sessions that learn from motions share: each motion planned before the first moves, played and recorded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from config import InputError, Installation
from config.schema import Mode
from driver.plan import Plan
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.procedure import Tell, within
from service.sessions.store import Session


def planned(
    names: Iterable[str], listed: str, installation: Installation, mode: Mode, controller: SessionController
) -> list[Plan]:
    """The motions of these names or files, or those that the installation has under ``listed``; all are checked against
    the limits. Raises InputError when there are none, or one is refused."""
    motions = tuple(names) or getattr(installation.arm, listed)
    if not motions:
        raise InputError(
            str(installation.path),
            f"arm {installation.arm.name} lists no {listed}",
            "list some under [arm], name motions, have one designed (--design), or give recordings",
        )
    return [plan_motion(name, installation, mode, controller) for name in motions]


async def play_recorded(
    moving: MovingArm,
    session: Session,
    plans: Sequence[Plan],
    tell: Tell,
    *,
    follow_load: bool = False,
    known_loads: Sequence[Path] = (),
) -> list[Path]:
    """Recordings of these plans of one mode, one after the other; the drives are off before and after. With
    ``follow_load`` the first begins only once the load is being followed; it may be one of the ``known_loads``.

    Raises ArmStopped when the arm stopped meanwhile.
    """
    if not plans:
        return []
    tell("enabling the drives", 0.0)
    await moving.enable(plans[0].mode, known_loads)
    if follow_load:
        await moving.load_followed()
    paths = []
    for k, plan in enumerate(plans):
        begin, middle, end = ((k + part) / len(plans) for part in (0.0, 0.5, 1.0))
        await moving.go_to(plan.q[0], plan.mode, within(tell, "moving to the next start", begin, middle))
        metadata = {"motion": plan.name, "mode": plan.mode, "controller": plan.controller}
        playing = within(tell, f"playing {plan.name}", middle, end)
        paths.append(await moving.play_recorded(plan, session, metadata, playing))
    await moving.disable()
    return paths
