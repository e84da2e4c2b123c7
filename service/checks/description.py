"""What follows from the installation's files alone: bus time, modes, motions. Loading has checked the rest."""

from __future__ import annotations

from collections.abc import Iterator

from config import InputError, Installation
from config.bus_time import cycle_budget
from config.motion import check_motion, load_motion, sample
from service.checks.finding import Finding

AREA = "description"
CROWDED = 0.9
"""Above this load a burst of SDO traffic or a repeated frame makes cycles late."""


def check_description(installation: Installation) -> Iterator[Finding]:
    """URDF and EDS (the loader has refused them otherwise), each bus in each mode, the arm's own motions."""
    joints = ", ".join(installation.joint_names)
    yield Finding(AREA, "URDF and EDS", "ok", f"agree with {installation.path.name} for {joints}")
    for bus in installation.bus:
        for mode in installation.modes:
            budget = cycle_budget(installation, bus, mode)
            subject = f"bus time of {bus.name} in {mode}"
            if not budget.fits:
                yield Finding(
                    AREA, subject, "fail", budget.sum_shown(), "lower rate_hz, or spread the drives over buses"
                )
            elif budget.load > CROWDED:
                yield Finding(AREA, subject, "warn", budget.sum_shown(), "little is left for repeated frames")
            else:
                yield Finding(AREA, subject, "ok", budget.sum_shown())
    for name in installation.arm.identification_motions:
        try:
            sampled = sample(load_motion(name, installation), installation.cycle.rate_hz)
            check_motion(sampled, installation, name)
        except InputError as error:
            yield Finding(AREA, f"motion {name}", "fail", error.problem, error.remedy)
        else:
            yield Finding(AREA, f"motion {name}", "ok", f"{sampled.t[-1]:.3g} s, inside all limits")
