"""Wrist force/torque sensors of the stand-in, at the level of the bytes on their serial lines."""

from __future__ import annotations

from pathlib import Path

from config import InputError, Installation
from virtual_hw.hidden.mechanics import HiddenMechanics, resolve_hidden
from virtual_hw.hidden.wrench_sensor import WrenchErrors
from virtual_hw.plant import Plant
from virtual_hw.wrench.bota import BotaSensor
from virtual_hw.wrench.line import PtyLine
from virtual_hw.wrench.robotiq import RobotiqSensor
from virtual_hw.wrench.sensor import Sensor
from virtual_hw.wrench.transducer import PROFILES, Transducer

__all__ = ["Sensor", "build_sensors"]

PROTOCOLS: dict[str, type[BotaSensor] | type[RobotiqSensor]] = {"bota": BotaSensor, "robotiq": RobotiqSensor}


def build_sensors(
    installation: Installation,
    hidden: HiddenMechanics | Path | str | None,
    plant: Plant,
    seed: int,
    run_dir: Path,
) -> list[Sensor]:
    """The installation's wrench sensors on pseudo-terminals, linked at their ``pty:`` paths under ``run_dir``.

    Raises InputError for a port that is no ``pty:`` path, or a link that cannot be made.
    """
    mechanics = resolve_hidden(installation, hidden)
    sensors: list[Sensor] = []
    try:
        for number, sensor in enumerate(installation.wrench_sensor):
            kind, _, where = sensor.port.partition(":")
            if kind != "pty" or not where:
                raise InputError(
                    f"wrench sensor {sensor.name}", f"its port {sensor.port} is a real one, which a stand-in cannot be",
                    "use pty:<path>",
                )  # fmt: skip
            errors = next((w for w in mechanics.wrench_sensor if w.sensor == sensor.name), None)
            errors = errors or WrenchErrors(sensor=sensor.name)
            transducer = Transducer(
                plant.tap_wrench(sensor.name), errors, PROFILES[sensor.profile], seed, number + 1, plant.step_s
            )
            line = PtyLine(run_dir / where, sensor.baud, round(errors.latency_ms * 1e6))
            sensors.append(PROTOCOLS[sensor.protocol](sensor, errors, transducer, line))
    except InputError:
        for built in sensors:
            built.close()
        raise
    return sensors
