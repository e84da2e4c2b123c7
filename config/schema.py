"""What an installation is, as types: one TOML file says all of it.

Units stand in the key names (``_rad``, ``_nm``, ``_hz``, ``_ms``); a key without a unit is a
count, a name or a ratio. Every model forbids keys it does not read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from config.drive import Drive, DriveIdentity, PdoLayout, PdoObject, SdoWrite
from config.errors import WrongKey
from config.section import FilePath, Mode, Name, Positive, Quantity, Section

__all__ = [
    "Arm",
    "Bus",
    "CycleTiming",
    "Drive",
    "DriveIdentity",
    "Encoder",
    "Gains",
    "Installation",
    "Joint",
    "JointLimits",
    "Mode",
    "Name",
    "PdoLayout",
    "PdoObject",
    "Positive",
    "Quantity",
    "SdoWrite",
    "Section",
    "VirtualHardware",
    "WrenchSensor",
]


class Arm(Section):
    """The rigid body. ``urdf`` is relative to the installation file."""

    name: Name
    description: str = ""
    urdf: FilePath
    tool_frame: Name
    """URDF link that carries the load, and the wrench sensor where there is one."""
    home_rad: tuple[float, ...]
    """Where sessions start and end, one value a joint."""
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, -9.81)
    floor_m: float | None = None
    """Height in the base's frame below which neither a joint's origin nor the tool goes in designed motions
    (`identify links --design`, `diagnose --experiment`); without it they keep the joints' limits alone."""
    identification_motions: tuple[str, ...] = ()
    """Motions that excite the links, by name or file: what `etude identify links` plays when given no recordings."""
    load_identification_motions: tuple[str, ...] = ()
    """Motions that turn a load against gravity and swing it: what `etude identify load` plays when given none."""


class CycleTiming(Section):
    """The cyclic loop."""

    rate_hz: Annotated[float, Field(ge=10, le=4000)]
    controller_rate_hz: Positive | None = None
    """Rate of the host-side controller in torque mode; the loop's own when absent."""
    missed_deadlines_to_stop: Annotated[int, Field(ge=1, le=100)] = 5
    """Consecutive late or incomplete cycles that turn holding into a damped stop."""
    heartbeat_ms: Annotated[int, Field(ge=5, le=1000)] = 20
    priority: Annotated[int, Field(ge=0, le=98)] = 80
    """SCHED_FIFO priority where permitted; 0 asks for none."""

    @property
    def period_ns(self) -> int:
        return round(1e9 / self.rate_hz)


class Bus(Section):
    """One CAN bus. ``channel`` is ``socketcan:<interface>`` or ``local:<path>``."""

    name: Name
    channel: Annotated[str, Field(pattern=r"^(socketcan|local):\S+$")]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000


class Encoder(Section):
    """Joint angle = sign · counts / counts_per_turn · 2π + zero_rad (counts on the joint's side of the gear)."""

    counts_per_turn: Annotated[float, Field(ge=16)]
    sign: Literal[1, -1] = 1
    zero_rad: float = 0.0


class JointLimits(Section):
    """What the gate lets through. Torque on the joint's side of the gear."""

    position_rad: tuple[float, float]
    velocity_rad_s: Positive
    acceleration_rad_s2: Positive
    torque_nm: Positive
    torque_rate_nm_s: Positive
    following_error_rad: Positive = 0.2
    """How far a joint may be from where it is told to be; drive (6065) and host watch it, and stop the arm beyond."""

    @model_validator(mode="after")
    def _ordered(self) -> JointLimits:
        low, high = self.position_rad
        if low >= high:
            raise WrongKey(
                "position_rad", f"the lower limit {low} is not below the upper limit {high}", "write [lower, upper]"
            )
        return self


class Gains(Section):
    """PD servo at the joint: tau = stiffness·(q_d − q) + damping·(dq_d − dq)."""

    stiffness_nm_rad: Annotated[float, Field(ge=0)]
    damping_nms_rad: Annotated[float, Field(ge=0)]


class Joint(Section):
    """One axis: a URDF joint and the drive that moves it."""

    name: Name
    bus: Name
    node_id: Annotated[int, Field(ge=1, le=127)]
    drive: Name
    """A drive layout: ``config/drives/<drive>.toml``, or a path beside the installation file."""
    encoder: Encoder
    rated_torque_nm: Positive
    """Joint torque at 1000 ‰ of the drive's rated torque (object 6076, through the gear)."""
    gear_ratio: float = 1.0
    """Motor turns a joint turn; only reports and the check of object 6076 use it."""
    limits: JointLimits
    servo: Gains
    """Gains of the servo in the drive (cyclic synchronous position)."""
    digital: Gains
    """Gains of the host's controller (cyclic synchronous torque)."""


class WrenchSensor(Section):
    """A wrist force/torque sensor on a serial line, in ``frame`` of the URDF."""

    name: Name
    protocol: Literal["bota", "robotiq"]
    port: Annotated[str, Field(pattern=r"^(/\S+|pty:\S+)$")]
    """Serial device, or ``pty:<path>``: the stand-in's port, a link in the run directory."""
    frame: Name
    rate_hz: Positive
    baud: Annotated[int, Field(ge=9600)] = 460_800
    """460 800 (Bota), 19 200 (Robotiq) when absent."""
    stale_ms: Positive = 20.0
    range_n: Positive
    range_nm: Positive
    profile: Literal["none", "astek", "rti"] = "none"
    """Filter of the sensor's own electronics, which the noise models start from."""

    @model_validator(mode="before")
    @classmethod
    def _usual_baud(cls, data: Any) -> Any:
        if isinstance(data, dict) and "baud" not in data and data.get("protocol") == "robotiq":
            return {**data, "baud": 19_200}
        return data

    @model_validator(mode="after")
    def _line_carries_rate(self) -> WrenchSensor:
        frame_bytes, fastest = {"bota": (37, 1000.0), "robotiq": (16, 100.0)}[self.protocol]
        fastest = min(fastest, self.baud / (10 * frame_bytes))
        if self.rate_hz > fastest:
            raise WrongKey(
                "rate_hz",
                f"{self.rate_hz:g} Hz is more than the {fastest:.4g} Hz of {self.protocol} at {self.baud} baud",
                f"give at most {int(fastest)}",
            )
        if self.stale_ms < 1000 / self.rate_hz:
            raise WrongKey(
                "stale_ms",
                f"{self.stale_ms:g} ms is shorter than one sample at {self.rate_hz:g} Hz, so each would be stale",
                f"give at least {3000 / self.rate_hz:.0f}",
            )
        return self


class VirtualHardware(Section):
    """The stand-in arm that may take this installation's place."""

    hidden: str | None = None
    """Mechanics that nothing but the stand-in reads; none: it is as the URDF says."""


class Installation(Section):
    """Everything about one laboratory's arm. `config.load_installation` makes it; drives are resolved."""

    arm: Arm
    cycle: CycleTiming
    bus: tuple[Bus, ...]
    joint: tuple[Joint, ...]
    wrench_sensor: tuple[WrenchSensor, ...] = ()
    virtual: VirtualHardware | None = None
    modes: tuple[Mode, ...] = ("csp", "cst")
    """Modes this installation may use; each must fit its buses."""
    path: Path
    """The TOML file; filled in by the loader."""
    drives: dict[str, Drive]
    """By drive name; filled in by the loader."""

    @field_validator("bus", "joint", "modes")
    @classmethod
    def _some(cls, value: tuple[Any, ...]) -> tuple[Any, ...]:
        if not value:
            raise ValueError("needs at least one entry")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Installation:
        for kind, names in (
            ("bus", [b.name for b in self.bus]),
            ("joint", [j.name for j in self.joint]),
            ("wrench_sensor", [s.name for s in self.wrench_sensor]),
        ):
            for k, name in enumerate(names):
                if name in names[:k]:
                    raise WrongKey(
                        f"{kind}[{k}].name",
                        f"{name!r} is the name of {kind}[{names.index(name)}] too",
                        "rename one of them",
                    )
        for kind, places in (
            ("bus[{}].channel", [b.channel for b in self.bus]),
            ("wrench_sensor[{}].port", [s.port for s in self.wrench_sensor]),
        ):
            for k, place in enumerate(places):
                if place in places[:k]:
                    raise WrongKey(kind.format(k), f"{place!r} is used twice", "give each its own")
        self._check_joints([b.name for b in self.bus])
        if len(self.arm.home_rad) != len(self.joint):
            raise WrongKey(
                "arm.home_rad",
                f"{len(self.arm.home_rad)} angles for {len(self.joint)} joints",
                "give one angle a joint",
            )
        for k, (joint, angle) in enumerate(zip(self.joint, self.arm.home_rad, strict=True)):
            low, high = joint.limits.position_rad
            if not low <= angle <= high:
                raise WrongKey(
                    f"arm.home_rad[{k}]",
                    f"{angle} rad is outside {joint.name}'s limits [{low}, {high}]",
                    "move it inside",
                )
        return self

    def _check_joints(self, buses: list[str]) -> None:
        seen: dict[tuple[str, int], str] = {}
        for k, joint in enumerate(self.joint):
            if joint.bus not in buses:
                raise WrongKey(f"joint[{k}].bus", f"{joint.bus!r} is not a bus", f"known are {', '.join(buses)}")
            if other := seen.get((joint.bus, joint.node_id)):
                raise WrongKey(
                    f"joint[{k}].node_id",
                    f"node {joint.node_id} on {joint.bus} is already {other}",
                    "give each drive on a bus a node number of its own",
                )
            seen[joint.bus, joint.node_id] = joint.name
            for mode in self.modes:
                if mode not in self.drives[joint.drive].layouts:
                    raise WrongKey(
                        f"joint[{k}].drive",
                        f"{joint.drive} has no layout for mode {mode}",
                        "add it, or drop it from modes",
                    )

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(j.name for j in self.joint)

    def drive_of(self, joint: Joint) -> Drive:
        return self.drives[joint.drive]

    def joints_on(self, bus: Bus) -> tuple[Joint, ...]:
        return tuple(j for j in self.joint if j.bus == bus.name)
