"""Wrench sensors on a serial line: the host's side of the Bota SensONE and the Robotiq FT 300."""

from config.schema import WrenchSensor
from driver.wrench.bota import BotaParser
from driver.wrench.parser import SampleStatus, WrenchParser
from driver.wrench.port import SensorLost, WrenchPort
from driver.wrench.robotiq import RobotiqParser

PARSERS: dict[str, type[WrenchParser]] = {"bota": BotaParser, "robotiq": RobotiqParser}


def make_parser(sensor: WrenchSensor) -> WrenchParser:
    """A parser of the sensor's protocol, at the start of a stream."""
    return PARSERS[sensor.protocol](sensor)


__all__ = ["SampleStatus", "SensorLost", "WrenchParser", "WrenchPort", "make_parser"]
