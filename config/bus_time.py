"""Worst-case time of one cycle on a CAN bus: what fits, and when the feedback of all drives has arrived."""

from __future__ import annotations

from dataclasses import dataclass

from config.drive import TEMPERATURE
from config.errors import InputError
from config.schema import Bus, Drive, Installation, Joint, Mode

_DRIVE_ANSWERS_US = 50.0
"""From the end of the SYNC to a drive's TPDO waiting for the bus."""
_LONGEST_FRAME_BYTES = 8


def frame_bits(data_bytes: int) -> int:
    """Worst-case bits of a standard-identifier data frame with stuffing and inter-frame space.

    47 + 8·n bits, of which 34 + 8·n are stuffed: at worst one bit more after each four (ISO 11898-1).
    Raises ValueError for more than 8 bytes.
    """
    if not 0 <= data_bytes <= 8:
        raise ValueError(f"a CAN frame carries 0 to 8 bytes, not {data_bytes}")
    stuffed = 34 + 8 * data_bytes
    return 47 + 8 * data_bytes + (stuffed - 1) // 4


@dataclass(frozen=True)
class BusItem:
    """Frames of one purpose. ``frames_per_cycle`` is below one for frames that do not come in each cycle."""

    name: str
    data_bytes: int
    frames_per_cycle: float
    us_per_cycle: float


@dataclass(frozen=True)
class BusBudget:
    """What one cycle puts on a bus, in the worst case of stuffing; times in µs."""

    bus: str
    mode: Mode
    items: tuple[BusItem, ...]
    total_us: float
    period_us: float

    @property
    def load(self) -> float:
        """Share of the cycle that the bus is busy; more than 1 does not fit."""
        return self.total_us / self.period_us

    @property
    def fits(self) -> bool:
        return self.total_us <= self.period_us

    def sum_shown(self) -> str:
        """The sum as one line: ``SYNC 55 + joint1 RPDO1 135 + … = 865 µs of 1000 µs (86 %)``."""
        terms = " + ".join(f"{i.name} {i.us_per_cycle:.4g}" for i in self.items)
        return f"{terms} = {self.total_us:.4g} µs of {self.period_us:.4g} µs ({100 * self.load:.3g} %)"


def cycle_budget(installation: Installation, bus: Bus, mode: Mode) -> BusBudget:
    """SYNC, all RPDOs and TPDOs of ``mode``, and the shares of seldom TPDOs and heartbeats on one bus of the
    installation."""
    us_per_bit = 1e6 / bus.bitrate
    period_us = installation.cycle.period_ns / 1000
    items = [_item("SYNC", 0, 1.0, us_per_bit)]
    joints = installation.joints_on(bus)
    for joint in joints:
        for name, data_bytes in _pdos(installation.drive_of(joint), mode):
            items.append(_item(f"{joint.name} {name}", data_bytes, 1.0, us_per_bit))
        items += _warmth(joint, installation.drive_of(joint), us_per_bit)
    per_cycle = (len(joints) + 1) * period_us / (1000 * installation.cycle.heartbeat_ms)
    items.append(_item("heartbeats", 1, per_cycle, us_per_bit))
    return BusBudget(bus.name, mode, tuple(items), sum(i.us_per_cycle for i in items), period_us)


def require_bus_time(installation: Installation, place: str) -> None:
    """Raise InputError, with the sum shown, for the first bus and mode that does not fit into its cycle."""
    for number, bus in enumerate(installation.bus):
        for mode in installation.modes:
            budget = cycle_budget(installation, bus, mode)
            if not budget.fits:
                raise InputError(
                    f"{place}: bus[{number}] ({bus.name})",
                    f"the frames of a cycle in mode {mode} do not fit: {budget.sum_shown()}",
                    f"use more buses, cycle.rate_hz of at most {_fitting_rate_hz(budget):g}, or shorter PDOs",
                )


def feedback_window_ns(installation: Installation, mode: Mode) -> int:
    """From the send of SYNC to the arrival of every drive's TPDOs in the worst case, over all buses; ns.

    SYNC waits for at most one frame that has begun; TPDOs follow it back to back. Never longer than the period.
    """
    longest = 0.0
    for bus in installation.bus:
        joints = installation.joints_on(bus)
        tpdos = [n for j in joints for name, n in _pdos(installation.drive_of(j), mode) if name.startswith("TPDO")]
        bits = frame_bits(_LONGEST_FRAME_BYTES) + frame_bits(0) + sum(frame_bits(n) for n in tpdos)
        longest = max(longest, bits * 1e6 / bus.bitrate)
    return min(round((longest + _DRIVE_ANSWERS_US) * 1000), installation.cycle.period_ns)


def _pdos(drive: Drive, mode: Mode) -> list[tuple[str, int]]:
    layout = drive.layouts[mode]
    return [
        (f"{way}{number}", sum(drive.object(name).bits for name in pdo) // 8)
        for way, pdos in (("RPDO", layout.rpdo), ("TPDO", layout.tpdo))
        for number, pdo in enumerate(pdos, 1)
        if pdo
    ]


def _warmth(joint: Joint, drive: Drive, us_per_bit: float) -> list[BusItem]:
    """The drive's TPDO of its temperature, which gives way to all others of its cycle."""
    told = drive.temperature
    if told is None:
        return []
    name, data_bytes = f"{joint.name} TPDO{told.tpdo}", drive.object(TEMPERATURE).bits // 8
    return [_item(name, data_bytes, 1.0 / told.every, us_per_bit)]


def _item(name: str, data_bytes: int, frames: float, us_per_bit: float) -> BusItem:
    return BusItem(name, data_bytes, frames, frames * frame_bits(data_bytes) * us_per_bit)


def _fitting_rate_hz(budget: BusBudget) -> float:
    """Highest rate, in steps of 10 Hz, at which the same frames fit; heartbeats' share of the bus does not change."""
    heartbeats = budget.items[-1].us_per_cycle
    cyclic_us = budget.total_us - heartbeats
    return 10 * int((1 - heartbeats / budget.period_us) * 1e6 / cyclic_us / 10)
