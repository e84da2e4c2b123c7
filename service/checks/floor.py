"""Whether the arm may be where it stands: its home, against the floor that designed motions stay above."""

from __future__ import annotations

from collections.abc import Iterator

from config import InputError, Installation
from service.checks.finding import Finding
from service.identification.arm_source import of_installation
from service.identification.designed_motion import limits_of

AREA = "description"
SUBJECT = "arm.floor_m"


def check_floor(installation: Installation) -> Iterator[Finding]:
    """The joints' origins and the tool at home; nothing where no floor is configured."""
    floor = installation.arm.floor_m
    if floor is None:
        return
    body = of_installation(installation).rigid_body(installation.joint_names, {})
    try:
        limits_of(installation, body)
    except InputError as error:
        yield Finding(AREA, SUBJECT, "fail", error.problem, error.remedy)
    else:
        yield Finding(AREA, SUBJECT, "ok", f"the arm's home is above {floor:g} m")
