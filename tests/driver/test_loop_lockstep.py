"""The loop on the stand-in arm, in lockstep: playing, stopping, faults, and the same bytes every time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest

from config import InputError, Installation
from config.schema import Mode
from driver.arm import ArmLoop
from driver.bus.channel import open_channel
from driver.bus.frames import pack
from driver.cyclic.cycle import Cycle, LoopState
from driver.cyclic.damping import REST_SPEED_RAD_S
from driver.cyclic.ring import RingReader
from driver.plan import Plan

StandIn = Callable[..., AbstractContextManager[int]]
MODES: tuple[Mode, ...] = ("csp", "cst")


class Bench:
    """A running loop and everything it has published."""

    def __init__(self, installation: Installation, arm: ArmLoop, reader: RingReader) -> None:
        self.installation, self.arm, self.reader = installation, arm, reader
        self.n = len(installation.joint)

    def cycles(self) -> list[Cycle]:
        lost, cycles = self.reader.cycles(limit=1_000_000)
        assert lost == 0
        return cycles

    def move(self, by_rad: float | list[float], seconds: float, mode: Mode = "csp", **rest: object) -> Plan:
        """A fifth-order move from where the arm holds."""
        start = np.array(self.arm.status().q_d)
        # Towards the middle of the range, so that test after test finds room.
        middle = np.array([sum(joint.limits.position_rad) / 2 for joint in self.installation.joint])
        samples = round(seconds * self.installation.cycle.rate_hz)
        s = np.linspace(0.0, 1.0, samples)[:, None]
        by = np.abs(by_rad) * np.where(start < middle, 1.0, -1.0)
        return Plan(
            q=start + (10 * s**3 - 15 * s**4 + 6 * s**5) * by,
            dq=(30 * s**2 - 60 * s**3 + 30 * s**4) * by / seconds,
            ddq=(60 * s - 180 * s**2 + 120 * s**3) * by / seconds**2,
            mode=mode,
            **rest,  # type: ignore[arg-type]
        )

    @contextmanager
    def injected(self, bus: int, frame: bytes) -> Iterator[None]:
        """Another node speaks on the bus; a frame that is no configuration is heard when time moves."""
        with open_channel(self.installation.bus[bus].channel) as stranger:
            stranger.send(frame)
            yield


@pytest.fixture(scope="module")
def running(dda: Installation, stand_in: StandIn, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    path = tmp_path_factory.mktemp("loop")
    with pytest.MonkeyPatch.context() as patch, stand_in(dda, path):
        patch.setenv("ETUDE_RUN", str(path))
        with ArmLoop.start(dda, lockstep=True, ring_name="loop") as arm, RingReader("loop", from_start=True) as reader:
            yield Bench(dda, arm, reader)


@pytest.fixture
def bench(running: Bench) -> Iterator[Bench]:
    """The arm idle at its start; whatever state a test leaves it in is ended."""
    running.cycles()
    yield running
    if running.arm.status().state is not LoopState.IDLE:
        running.arm.stop("end of a test")
        running.arm.reset()


@pytest.mark.parametrize("mode", MODES)
def test_a_motion_is_followed_and_the_arm_holds_at_its_end(bench: Bench, mode: Mode) -> None:
    bench.arm.enable(mode)
    bench.cycles()
    plan = bench.move([0.4, 0.3, 0.5], 0.6, mode)
    run = bench.arm.play(plan)
    status = bench.arm.wait(run)
    assert (status.run_outcome, status.progress, status.state) == ("done", 1.0, LoopState.HOLDING)
    cycles = bench.cycles()
    played = [c for c in cycles if c.run == run]
    assert np.array_equal([c.q_d for c in played], plan.q)
    assert all(all(c.valid) for c in played)
    error = np.array([c.q for c in played]) - plan.q
    assert np.abs(error).max() < 0.03
    assert np.abs(np.array([c.dq for c in cycles[-5:]])).max() < 0.2
    assert status.missed == 0 and status.good_cycles == status.cycles
    bench.arm.disable()
    assert bench.arm.status().state is LoopState.IDLE
    assert all("switch on disabled" in words for words in bench.arm.status().drive_states)


@pytest.mark.parametrize("controller", ["pd", "pd+ff", "computed_torque"])
def test_torque_never_jumps_between_holding_and_playing(bench: Bench, controller: str) -> None:
    bench.arm.enable("cst")
    plan = bench.move(0.2, 0.4, "cst", controller=controller)
    bench.arm.wait(bench.arm.play(plan))
    cycles = [c for c in bench.cycles() if c.state in (LoopState.HOLDING, LoopState.PLAYING)]
    tau_ff = np.array([c.tau_ff for c in cycles])
    if controller != "computed_torque":  # whose feedforward follows the measured state
        steps = np.abs(np.diff(tau_ff, axis=0)).max(axis=0)
        span = np.abs(tau_ff).max(axis=0)
        assert (steps <= 0.05 * span + 1e-9).all()
    holding = np.array([c.tau_ff for c in cycles if c.state is LoopState.HOLDING])
    assert np.abs(holding[0][1]) > 1.0, "a loaded joint is held with its gravity torque"


def test_a_slow_controller_keeps_its_torque_between_its_instants(bench: Bench) -> None:
    bench.arm.enable("cst")
    run = bench.arm.play(bench.move(0.2, 0.6, "cst", controller_rate_hz=133.0))
    assert bench.arm.wait(run).run_outcome == "done"
    tau = np.array([c.tau_command for c in bench.cycles() if c.run == run])
    changes = (np.abs(np.diff(tau, axis=0)) > 0).any(axis=1).sum()
    assert 0.9 * 0.6 * 133 <= changes <= 1.1 * 0.6 * 133


@pytest.mark.parametrize("mode", MODES)
def test_a_stop_brings_the_moving_arm_to_rest_before_it_lets_go(bench: Bench, mode: Mode) -> None:
    bench.arm.enable(mode)
    bench.cycles()
    run = bench.arm.play(bench.move([1.0, 0.8, 1.0], 0.8, mode))
    while bench.arm.status().progress < 0.4:
        pass
    bench.arm.stop("a test says so")
    status = bench.arm.status()
    assert (status.state, status.cause, status.run_outcome) == (LoopState.LATCHED, "a test says so", "a test says so")
    assert all("switch on disabled" in words for words in status.drive_states)
    assert len(status.last_frames) > 20
    cycles = bench.cycles()
    assert np.abs([c.dq for c in cycles if c.run == run][-1]).max() > 1.0, "it was moving"
    stopping = [c for c in cycles if c.state is LoopState.STOPPING]
    speed = np.abs(np.array([c.dq for c in stopping])).max(axis=1)
    at_rest = int(np.argmax(speed < REST_SPEED_RAD_S))
    assert 0 < at_rest < 800
    # Never zero torque first: enabled drives are commanded until the arm is at rest, and gravity is carried then.
    first_off = next(k for k, c in enumerate(stopping) if 0x0F not in [w & 0x0F for w in controlwords(bench, c)])
    assert first_off > at_rest
    assert abs(stopping[first_off - 1].tau_command[1]) > 1.0
    travelled = np.array(stopping[-1].q) - np.array(stopping[0].q)
    assert np.abs(travelled).max() < 0.3
    assert any("a test says so" in event for c in cycles for event in c.events)
    with pytest.raises(InputError, match=r"a test says so.*reset"):
        bench.arm.enable(mode)
    bench.arm.reset()
    assert bench.arm.status().state is LoopState.IDLE
    bench.arm.enable(mode)
    resumed = bench.reader.latest()
    assert resumed is not None
    assert np.abs(np.array(resumed.q) - np.array(stopping[-1].q)).max() < 0.02, "it resumes where it stands"


def controlwords(bench: Bench, cycle: Cycle) -> list[int]:
    rpdo1 = {0x200 + joint.node_id for joint in bench.installation.joint}
    frames = [f.data for f in cycle.frames if f.sent and int.from_bytes(f.data[:4], "little") in rpdo1]
    return [int.from_bytes(data[8:10], "little") for data in frames]


def test_an_emergency_of_one_axis_stops_all_axes_in_the_same_cycle(bench: Bench) -> None:
    bench.arm.enable("csp")
    with bench.injected(1, pack(0x080 + 2, bytes((0x10, 0x43, 0x08, 0, 0, 0, 0, 0)))):
        bench.arm.run_for(0.5)
    status = bench.arm.status()
    assert status.state is LoopState.LATCHED
    assert status.cause is not None and status.cause.startswith("joint2: ") and "too hot" in status.cause
    cycles = bench.cycles()
    heard = next(k for k, c in enumerate(cycles) if any(f.data[:2] == b"\x82\x00" for f in c.frames))
    assert cycles[heard - 1].state is LoopState.HOLDING
    assert cycles[heard].state is LoopState.STOPPING


@pytest.mark.parametrize("mode", MODES)
def test_a_drive_that_falls_silent_stops_the_others_and_is_set_up_anew_by_a_reset(bench: Bench, mode: Mode) -> None:
    bench.arm.enable(mode)
    run = bench.arm.play(bench.move(0.5, 0.6, mode))
    while bench.arm.status().progress < 0.3:
        pass
    with bench.injected(2, pack(0x000, bytes((0x02, 3)))):  # NMT: node 3 stops, and with it its PDOs.
        bench.arm.wait(run)
    while (status := bench.arm.status()).state is not LoopState.LATCHED:
        assert status.state is LoopState.STOPPING
    assert status.cause is not None and status.cause.startswith("joint3: ")
    assert status.valid == (True, True, False) and np.isnan(status.q[2])
    cycles = bench.cycles()
    silent = [c for c in cycles if not c.valid[2]]
    assert silent and all(np.isnan(c.q[2]) and np.isnan(c.tau[2]) for c in silent), "nothing is repeated"
    assert np.abs(silent[-1].dq[:2]).max() < REST_SPEED_RAD_S
    bench.arm.reset()
    bench.arm.enable(mode)
    assert bench.arm.status().state is LoopState.HOLDING
    assert all(bench.arm.status().valid)


def test_a_plan_that_does_not_fit_is_refused_and_nothing_moves(bench: Bench, dda: Installation) -> None:
    bench.arm.enable("csp")
    before = bench.arm.status()
    good = bench.move(0.2, 0.5)
    far = bench.move([5.0, 0.0, 0.0], 5.0)
    fast = bench.move(0.5, 0.06)
    elsewhere = Plan(q=good.q + 0.03, dq=good.dq, ddq=good.ddq, mode="csp")
    moving = Plan(q=good.q[200:], dq=good.dq[200:], ddq=good.ddq[200:], mode="csp")
    narrow = Plan(q=good.q[:, :2], dq=good.dq[:, :2], ddq=good.ddq[:, :2], mode="csp")
    torque = bench.move(0.2, 0.5, "cst")
    for plan, words in (
        (far, "joint1: position .* beyond its limit"),
        (fast, "joint1: (velocity|acceleration|step)"),
        (elsewhere, "begins at .* the arm holds at .*move to its start"),
        (moving, "(begin and end at rest|move to its start)"),
        (narrow, "has 2 joints"),
        (torque, "enable that mode first"),
    ):
        with pytest.raises(InputError, match=words):
            bench.arm.play(plan)
    assert bench.arm.status().cycles == before.cycles, "not even time has passed"
    with pytest.raises(InputError, match="is nan at sample 3"):
        q = good.q.copy()
        q[3, 1] = np.nan
        Plan(q=q, dq=good.dq, ddq=good.ddq)
    assert bench.arm.wait(bench.arm.play(good)).run_outcome == "done"


def test_the_same_requests_give_the_same_bytes(dda: Installation, stand_in: StandIn, tmp_path: Path) -> None:
    recorded: list[list[bytes]] = []
    for attempt in range(2):
        run_dir = tmp_path / str(attempt)
        run_dir.mkdir()
        with pytest.MonkeyPatch.context() as patch, stand_in(dda, run_dir, seed=7):
            patch.setenv("ETUDE_RUN", str(run_dir))
            with (
                ArmLoop.start(dda, lockstep=True, ring_name="same") as arm,
                RingReader("same", from_start=True) as reader,
            ):
                bench = Bench(dda, arm, reader)
                arm.enable("cst")
                arm.wait(arm.play(bench.move(0.3, 0.3, "cst")))
                arm.disable()
                lost, slots = reader.take(1_000_000)
                assert lost == 0 and len(slots) > 300
                recorded.append(slots)
    first, second = recorded
    assert len(first) == len(second)
    different = [k for k, (a, b) in enumerate(zip(first, second, strict=True)) if a != b]
    assert not different, f"{len(different)} cycles differ, the first is {different[0]}"


def test_a_second_host_of_the_same_stand_in_hears_the_wrist_sensor_too(
    dda: Installation, stand_in: StandIn, tmp_path: Path
) -> None:
    """Its line had carried bytes before that host came."""
    with pytest.MonkeyPatch.context() as patch, stand_in(dda, tmp_path):
        patch.setenv("ETUDE_RUN", str(tmp_path))
        for ring_name in ("first", "second"):
            with ArmLoop.start(dda, lockstep=True, ring_name=ring_name) as arm:
                arm.enable("csp")
                (sensor,) = arm.status().sensors
                assert sensor.condition == "valid", ring_name
                assert sensor.samples > 10, ring_name
                arm.disable()
