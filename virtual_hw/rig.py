"""Buses, drives, arm and sensors of one installation on one clock."""

from __future__ import annotations

from collections.abc import Callable

from config import Installation
from virtual_hw.bus.wire import Bus
from virtual_hw.drive.node import DriveNode
from virtual_hw.drive.power_stage import Arm, PowerStage

_POWER_UP_NS = 100_000_000
"""The drives are switched on this long before the clock starts: their boot-up messages are over by then."""
LONGEST_PIECE_NS = 300_000


class Rig:
    """All of the stand-in but its sockets. Time is moved by `advance` alone."""

    def __init__(self, installation: Installation, arm: Arm, start_ns: int) -> None:
        """
        Raises:
            InputError: a drive's EDS is not that of a CiA 402 drive.
        """
        self.now_ns = start_ns
        self.buses = [Bus(bus.name, bus.bitrate, start_ns - _POWER_UP_NS) for bus in installation.bus]
        self.power_stage = PowerStage(arm, installation.joint)
        by_name = {bus.name: bus for bus in self.buses}
        self.nodes = [
            DriveNode(
                joint, installation.drive_of(joint), by_name[joint.bus], arm.tick_ns, MotorOf(self.power_stage, i)
            )
            for i, joint in enumerate(installation.joint)
        ]
        self.tick_ns = arm.tick_ns
        self.at_ticks: list[Callable[[int], None]] = []
        """Called with the time before each servo tick."""
        self.sense_tampers: list[Callable[[list[int], list[float]], None]] = []
        """Faults of encoders: change counts and counts/s of all drives."""
        self.demand_tampers: list[Callable[[list[float], list[bool]], None]] = []
        """Faults of motors and brakes: change torque demands and brakes of all drives."""
        self.next_tick_ns = start_ns
        """When the next servo tick is due."""
        """Time of the servo tick that is due."""
        senses = self.power_stage.senses
        for i, node in enumerate(self.nodes):
            node.axis.sense(senses.counts[i], senses.speed[i])
        for bus in self.buses:
            bus.run_until(start_ns)

    def advance(self, t_ns: int) -> None:
        """Move time on to ``t_ns``: all bus traffic ended by then, all servo ticks up to and including it."""
        while self.next_tick_ns <= t_ns:
            tick = self.next_tick_ns
            self._run_buses(tick)
            self._servo_tick(tick)
            self.next_tick_ns = tick + self.tick_ns
        if self.now_ns != t_ns:
            self._run_buses(t_ns)

    def _run_buses(self, t_ns: int) -> None:
        for bus in self.buses:
            bus.run_until(t_ns)
        self.now_ns = t_ns

    def next_event_ns(self) -> int:
        """When `advance` is to be called next: at the servo tick, or before it when a bus has carried what it has.

        Hosts are told frames then, as a CAN adapter tells them in packets; a bus that stays busy is told in pieces.
        """
        due = self.next_tick_ns
        for bus in self.buses:
            quiet = bus.quiet_ns()
            if quiet is not None:
                due = min(due, quiet, self.now_ns + LONGEST_PIECE_NS)
        return due

    def _servo_tick(self, now_ns: int) -> None:
        for act in self.at_ticks:
            act(now_ns)
        stage = self.power_stage
        senses = stage.at_tick()
        counts, speed = senses.counts, senses.speed
        for tamper in self.sense_tampers:
            tamper(counts, speed)
        torque = [node.tick(now_ns, counts[i], speed[i]) for i, node in enumerate(self.nodes)]
        brakes = [node.axis.brake for node in self.nodes]
        for change in self.demand_tampers:
            change(torque, brakes)
        stage.demand(torque, brakes)


class MotorOf:
    """One drive's view of the power stage: `virtual_hw.drive.measured.MotorSenses`."""

    def __init__(self, stage: PowerStage, i: int) -> None:
        self._stage, self._i = stage, i

    def torque_nm(self) -> float:
        return self._stage.senses.torque[self._i]

    def currents_a(self) -> tuple[float, float, float]:
        return self._stage.currents_a(self._i)

    def temperature_c(self) -> float:
        return self._stage.temperature_c(self._i)
