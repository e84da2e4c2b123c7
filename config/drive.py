"""A type of drive, as types: identity, PDO layouts and start-up writes; a TOML file beside the drive's EDS."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.errors import WrongKey
from config.section import FilePath, Mode, Name, Positive, Quantity, Section


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
    from_key: Quantity | None = None
    """A quantity that the joint's configuration fixes: ``servo_stiffness``, ``servo_damping``,
    ``torque_limit``, ``velocity_limit``, ``position_low``, ``position_high``."""
    scale: float = 1.0
    """Raw = round(scale · quantity) (quantities: N·m/rad, N·m·s/rad, ‰ of rated, counts/s, counts)."""

    @model_validator(mode="after")
    def _one_source(self) -> SdoWrite:
        if (self.value is None) == (self.from_key is None):
            raise WrongKey("value", "must stand alone or give way to from_key", "give exactly one of the two")
        return self


NEEDED: dict[tuple[Mode, str], tuple[str, ...]] = {
    ("csp", "rpdo"): ("controlword", "target_position"),
    ("csp", "tpdo"): ("statusword", "position", "torque"),
    ("cst", "rpdo"): ("controlword", "target_torque"),
    ("cst", "tpdo"): ("statusword", "position", "torque"),
}
"""Objects without which a mode cannot be commanded, or its feedback not be judged."""


TEMPERATURE = "temperature"
"""The object's name that tells how warm the motor is."""
COLDEST, HOTTEST = -60.0, 250.0
"""°C; no motor that turns is colder or hotter, but what is told in kelvin, or without a thermometer, reads so."""


class DriveTemperature(Section):
    """The object ``temperature`` travels in a TPDO of its own, seldom: a motor does not warm within a cycle."""

    celsius_per_count: Positive
    tpdo: Annotated[int, Field(ge=1, le=4)] = 4
    """Number of a TPDO that no layout uses."""
    every: Annotated[int, Field(ge=2, le=240)] = 240
    """It comes at each so-many-th SYNC: the TPDO's transmission type (CiA 301)."""


class DriveIdentity(Section):
    """Object 1018 and 1000; a drive that answers otherwise is refused."""

    device_type: int
    vendor_id: int
    product_code: int
    revision: int | None = None


class Drive(Section):
    """One type of drive: its EDS, identity, PDO layouts and start-up writes."""

    name: Name
    eds: FilePath
    identity: DriveIdentity
    objects: tuple[PdoObject, ...]
    layouts: dict[Mode, PdoLayout]
    start_up: tuple[SdoWrite, ...] = ()
    temperature: DriveTemperature | None = None
    """Where the drive tells how warm its motor is; recordings then hold it."""
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
                key = f"layouts.{mode}.{way}"
                if len(pdos) > 4:
                    raise WrongKey(key, f"{len(pdos)} PDOs, at most 4", "map the objects into fewer PDOs")
                mapped = [name for pdo in pdos for name in pdo]
                for k, pdo in enumerate(pdos):
                    for name in pdo:
                        if name not in known:
                            raise WrongKey(f"{key}[{k}]", f"object {name!r} is not among objects", "add an [[objects]]")
                        if mapped.count(name) > 1:
                            raise WrongKey(f"{key}[{k}]", f"object {name!r} is mapped twice", "map it once")
                    bits = sum(known[name].bits for name in pdo)
                    if not 0 < bits <= 64:
                        raise WrongKey(f"{key}[{k}]", f"{bits} bits are not 1 to 8 bytes", "use another PDO")
                for name in NEEDED[mode, way]:
                    if name not in mapped:
                        raise WrongKey(key, f"mode {mode} needs the object {name!r}", "map it")
        return self

    @model_validator(mode="after")
    def _warmth_apart(self) -> Drive:
        if self.temperature is None:
            return self
        if TEMPERATURE not in (o.name for o in self.objects):
            raise WrongKey("temperature", f"object {TEMPERATURE!r} is not among objects", "add an [[objects]]")
        number = self.temperature.tpdo
        for mode, layout in self.layouts.items():
            if any(TEMPERATURE in pdo for pdo in layout.tpdo):
                raise WrongKey(
                    f"layouts.{mode}.tpdo", f"maps {TEMPERATURE!r}, which has a TPDO of its own", "remove it"
                )
            if number <= len(layout.tpdo):
                raise WrongKey("temperature.tpdo", f"TPDO {number} is that of layouts.{mode}", "give a free one")
        return self

    def object(self, name: str) -> PdoObject:
        return next(o for o in self.objects if o.name == name)
