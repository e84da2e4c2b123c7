"""Which rigid body a recording is of: a configured arm, or any URDF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from config import InputError, Installation, load_installation
from driver.recording import Recording
from estimator.rigid_body import RigidBody, load_rigid_body

GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class ArmSource:
    """Where an arm's rigid body comes from. ``joints``: the configured ones, None when a URDF alone was given."""

    name: str
    urdf: Path
    joints: tuple[str, ...] | None = None
    gravity: tuple[float, float, float] = GRAVITY
    installation: Installation | None = None

    def rigid_body(self, recorded: Sequence[str], hold: Mapping[str, float]) -> RigidBody:
        """The rigid body with the joints that move in a recording of ``recorded`` joints; the URDF's others are held.

        Raises InputError when the recording lacks a configured joint, or has one that the URDF does not know.
        """
        if self.joints is not None:
            missing = [name for name in self.joints if name not in recorded and name not in hold]
            if missing:
                raise InputError(
                    "recording",
                    f"lacks joint {', '.join(missing)} of arm {self.name} (it has {', '.join(recorded)})",
                    "name --arm as the arm it was recorded on, or hold the joint: --hold JOINT=VALUE",
                )
        moving = [name for name in (self.joints or recorded) if name not in hold]
        return load_rigid_body(self.urdf, moving, hold, self.gravity)

    def all_joints(self) -> tuple[str, ...]:
        """The configured joints, or every moving joint of the URDF."""
        return self.joints or load_rigid_body(self.urdf, gravity=self.gravity).joints


def arm_source(arm: str) -> ArmSource:
    """The arm that ``--arm`` names: a URDF file, an installation file, or a configured arm's name."""
    path = Path(arm)
    if path.suffix.lower() == ".xacro":
        raise InputError(arm, "is a macro of a URDF", f"expand it: xacro {arm} > {path.stem}.urdf")
    if path.suffix.lower() in (".urdf", ".xml"):
        if not path.is_file():
            raise InputError(arm, "there is no such file", "give the path of the arm's URDF")
        return ArmSource(path.stem, path.absolute())
    installation = load_installation(arm)
    return of_installation(installation)


def of_installation(installation: Installation) -> ArmSource:
    """The rigid body as an installation has it."""
    urdf = installation.path.parent / installation.arm.urdf
    return ArmSource(installation.arm.name, urdf, installation.joint_names, installation.arm.gravity_m_s2, installation)


def recorded_arm(recording: Recording, path: Path) -> ArmSource:
    """The arm that a recording says it is of. Raises InputError when it says none, or one that is not known here."""
    if recording.arm is None:
        raise InputError(str(path), "does not say which arm it is of", "name it: --arm NAME, or --arm FILE.urdf")
    if recording.installation is not None and recording.installation.path.is_file():
        return of_installation(recording.installation)
    try:
        return of_installation(load_installation(recording.arm))
    except InputError as error:
        raise InputError(
            str(path), f"is of arm {recording.arm}, which is not configured here ({error.problem})", "name --arm"
        ) from None


def parse_holds(given: Sequence[str]) -> dict[str, float]:
    """``JOINT=VALUE`` (rad or m) options as a mapping. Raises InputError on anything else."""
    holds: dict[str, float] = {}
    for text in given:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
            if not (name and equals and math.isfinite(number)):
                raise ValueError
        except ValueError:
            raise InputError(f"--hold {text}", "is not JOINT=VALUE", "write for instance --hold torso=0.1") from None
        if name in holds:
            raise InputError(f"--hold {text}", f"joint {name} is held twice", "hold it once")
        holds[name] = number
    return holds
