"""What an installation is, as types: one TOML file says all of it.

Units stand in the key names (``_rad``, ``_nm``, ``_hz``, ``_ms``); a key without a unit is a
count, a name or a ratio. Every model forbids keys it does not read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]*$")]
Mode = Literal["csp", "cst"]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Arm(Section):
    """The rigid body. ``urdf`` is relative to the installation file."""

    name: Name
    description: str = ""
    urdf: Path
    tool_frame: Name
    """URDF link that carries the load, and the wrench sensor where there is one."""
    home_rad: tuple[float, ...]
    """Where sessions start and end, one value a joint."""
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, -9.81)
    identification_motions: tuple[str, ...] = ()
    """Motions that excite the links, by name or file: what `etude identify links` plays when given no recordings."""


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

    @model_validator(mode="after")
    def _ordered(self) -> JointLimits:
        low, high = self.position_rad
        if low >= high:
            raise ValueError(f"position_rad: the lower limit {low} is not below the upper limit {high}")
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
    port: str
    """Serial device, or ``pty:<path>``: the stand-in's port, a link in the run directory."""
    frame: Name
    rate_hz: Positive
    baud: Annotated[int, Field(ge=9600)] = 460_800
    stale_ms: Positive = 20.0
    range_n: Positive
    range_nm: Positive
    profile: Literal["none", "astek", "rti"] = "none"
    """Filter of the sensor's own electronics, which the noise models start from."""


class VirtualHardware(Section):
    """The stand-in arm that may take this installation's place."""

    hidden: str
    """Mechanics that nothing but the stand-in reads."""


class PdoObject(Section):
    """One object of a PDO mapping: a name of `driver`'s and `virtual_hw`'s codecs, and where it lives."""

    name: Name
    index: Annotated[int, Field(ge=0x1000, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=254)] = 0
    type: Literal["u8", "i8", "u16", "i16", "u32", "i32"]

    @property
    def bits(self) -> int:
        return int(self.type[1:])


class PdoLayout(Section):
    """Mapping of the PDOs of one mode, by object name; at most 8 bytes a PDO, at most four PDOs each way."""

    rpdo: tuple[tuple[Name, ...], ...]
    tpdo: tuple[tuple[Name, ...], ...]


class SdoWrite(Section):
    """One configuration write, read back and compared. ``value`` is raw, or ``from_key`` a joint's setting."""

    index: Annotated[int, Field(ge=0x1000, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=254)] = 0
    value: int | None = None
    from_key: str | None = None
    """A quantity that the joint's configuration fixes: ``servo_stiffness``, ``servo_damping``,
    ``torque_limit``, ``velocity_limit``, ``position_low``, ``position_high``."""
    scale: float = 1.0
    """Raw = round(scale · quantity) (quantities: N·m/rad, N·m·s/rad, ‰ of rated, counts/s, counts)."""

    @model_validator(mode="after")
    def _one_source(self) -> SdoWrite:
        if (self.value is None) == (self.from_key is None):
            raise ValueError("give either value or from_key")
        return self


class DriveIdentity(Section):
    """Object 1018 and 1000; a drive that answers otherwise is refused."""

    device_type: int
    vendor_id: int
    product_code: int
    revision: int | None = None


class Drive(Section):
    """One type of drive: its EDS, identity, PDO layouts and start-up writes."""

    name: Name
    eds: Path
    identity: DriveIdentity
    objects: tuple[PdoObject, ...]
    layouts: dict[Mode, PdoLayout]
    start_up: tuple[SdoWrite, ...] = ()
    velocity_unit: Literal["counts_per_s"] = "counts_per_s"
    quick_stop_option: int = 6
    """Object 605A: slow down on the quick-stop ramp and stay."""
    connection_lost_option: int = 3
    """Object 6007: quick stop, by the standard; some vendors swap 2 and 3."""
    fault_reaction_option: int = 2

    @model_validator(mode="after")
    def _mapped(self) -> Drive:
        known = {o.name: o for o in self.objects}
        for mode, layout in self.layouts.items():
            for way, pdos in (("rpdo", layout.rpdo), ("tpdo", layout.tpdo)):
                if len(pdos) > 4:
                    raise ValueError(f"layouts.{mode}.{way}: {len(pdos)} PDOs, at most 4")
                for k, pdo in enumerate(pdos, 1):
                    for name in pdo:
                        if name not in known:
                            raise ValueError(f"layouts.{mode}.{way}: object {name!r} is not in objects")
                    bits = sum(known[name].bits for name in pdo)
                    if bits > 64:
                        raise ValueError(f"layouts.{mode}.{way} number {k}: {bits} bits do not fit in 8 bytes")
        return self

    def object(self, name: str) -> PdoObject:
        return next(o for o in self.objects if o.name == name)


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

    @field_validator("bus", "joint")
    @classmethod
    def _some(cls, value: tuple[Section, ...]) -> tuple[Section, ...]:
        if not value:
            raise ValueError("needs at least one entry")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Installation:
        buses = [b.name for b in self.bus]
        for kind, names in (
            ("bus", buses),
            ("joint", [j.name for j in self.joint]),
            ("wrench_sensor", [s.name for s in self.wrench_sensor]),
        ):
            doubled = {n for n in names if names.count(n) > 1}
            if doubled:
                raise ValueError(f"{kind}: {', '.join(sorted(doubled))} is named twice; rename one")
        seen: dict[tuple[str, int], str] = {}
        for j in self.joint:
            if j.bus not in buses:
                raise ValueError(f"joint {j.name}: bus {j.bus!r} is not one of {', '.join(buses)}")
            if (j.bus, j.node_id) in seen:
                raise ValueError(
                    f"joint {j.name}: node {j.node_id} on {j.bus} is already joint {seen[j.bus, j.node_id]}"
                )
            seen[j.bus, j.node_id] = j.name
        if len(self.arm.home_rad) != len(self.joint):
            raise ValueError(f"arm.home_rad: {len(self.arm.home_rad)} angles for {len(self.joint)} joints")
        return self

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(j.name for j in self.joint)

    def drive_of(self, joint: Joint) -> Drive:
        return self.drives[joint.drive]

    def joints_on(self, bus: Bus) -> tuple[Joint, ...]:
        return tuple(j for j in self.joint if j.bus == bus.name)
