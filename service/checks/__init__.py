"""Is this installation sound? Everything that can be seen without moving the arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from config import Installation
from service.checks.buses import check_buses
from service.checks.description import check_description
from service.checks.finding import Finding
from service.checks.floor import check_floor
from service.checks.places import check_places
from service.checks.realtime import check_realtime
from service.checks.sensors import check_sensors
from service.checks.servos import check_servos

__all__ = ["Finding", "run_checks"]

CHECKS: tuple[Callable[[Installation], Iterator[Finding]], ...] = (
    check_description,
    check_servos,
    check_floor,
    check_places,
    check_realtime,
    check_buses,
    check_sensors,
)


def run_checks(installation: Installation) -> Iterator[Finding]:
    """All findings, area after area. Nothing moves, nothing is written to a drive."""
    for check in CHECKS:
        yield from check(installation)
