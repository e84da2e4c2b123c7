"""What recording costs a message, and what is lost when the recorder is killed.

Real cycles of the direct drive arm, taken from its loop's ring in lockstep, are written again: by the recorder's
writer for the cost, beside the JointState messages of the `mcap_ros2` writer; by the recorder's process at the loop's
pace, killed at several instants, for the loss.
"""

from __future__ import annotations

import io
import os
import signal
import tempfile
import time
from pathlib import Path

from mcap_ros2.writer import Writer

from benchmarks.figure import Figure
from benchmarks.standin import running
from config import Installation
from driver.cyclic.cycle import Cycle
from driver.cyclic.ring import RingReader, RingWriter
from driver.recording import RecorderProcess, read_recording, recover
from driver.recording.run_writer import RunWriter

CYCLES = 4000
KILLS = 5
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def real_cycles() -> tuple[Installation, list[Cycle]]:
    """Cycles of the enabled arm, with their raw frames."""
    with running("dda", lockstep=True) as (installation, loop, ring):
        loop.enable("csp")
        with RingReader(ring) as reader:
            reader.register_recorder()
            cycles: list[Cycle] = []
            while len(cycles) < CYCLES:
                loop.run_for(0.2)
                cycles += reader.cycles(limit=1000)[1]
    return installation, [c for c in cycles if any(c.valid)]


def cost_us(installation: Installation, cycles: list[Cycle], path: Path) -> float:
    """CPU µs a message of everything that a cycle leaves in the file."""
    writer = RunWriter(path, installation, {"mode": "csp"}, ())
    start = time.process_time()
    for cycle in cycles:
        writer.write(cycle)
    cost = time.process_time() - start
    writer.finish()
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    return cost / summary.statistics.message_count * 1e6


def mcap_ros2_cost_us(cycles: list[Cycle]) -> float:
    writer = Writer(io.BytesIO())
    schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
    start = time.process_time()
    for cycle in cycles:
        seconds, nanoseconds = divmod(cycle.time_ns, 10**9)
        header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": ""}
        message: dict[str, object] = {"header": header, "name": ["joint1", "joint2", "joint3"]}
        message |= {"position": cycle.q, "velocity": cycle.dq, "effort": cycle.tau}
        writer.write_message("/joint_states", schema, message, cycle.time_ns, cycle.time_ns)
    cost = time.process_time() - start
    writer.finish()
    return cost / len(cycles) * 1e6


def loss_ms(installation: Installation, cycles: list[Cycle], folder: Path, name: str, after_s: float) -> float:
    """Loop time missing at the end of the recovered file, when the recorder is killed ``after_s`` into a run."""
    period_ns = installation.cycle.period_ns
    ring = RingWriter(name, len(installation.joint), period_ns=period_ns, lockstep=False)
    recorder = RecorderProcess.start(installation, name, folder)
    try:
        path = recorder.start_run(name, metadata={"mode": "csp"})
        start, published = time.monotonic_ns(), 0
        while time.monotonic_ns() - start < after_s * 1e9:
            while published < len(cycles) and published * period_ns <= time.monotonic_ns() - start:
                c = cycles[published]
                valid = sum(ok << i for i, ok in enumerate(c.valid))
                values = (*c.q, *c.dq, *c.tau, *c.q_d, *c.dq_d, *c.tau_command, *c.tau_ff)
                frames = [(f.bus, f.sent, f.time_ns, f.data) for f in c.frames]
                ring.publish(published, c.time_ns, 0, int(c.state), 1, valid, values, None, frames, c.serial, c.events)
                published += 1
            time.sleep(0.0005)
        assert recorder.pid is not None
        os.kill(recorder.pid, signal.SIGKILL)
    finally:
        recorder.close()
        ring.close()
    recover(path)
    kept = read_recording(path)
    return (cycles[published - 1].time_ns / 1e9 - (cycles[0].time_ns / 1e9 + float(kept.t[-1] - kept.t[0]))) * 1e3


def measure() -> list[Figure]:
    installation, cycles = real_cycles()
    with tempfile.TemporaryDirectory(prefix="etude-") as folder:
        os.environ["ETUDE_RUN"] = folder
        cost = cost_us(installation, cycles, Path(folder) / "cost.mcap")
        losses = [loss_ms(installation, cycles, Path(folder), f"k{k}", 0.9 + 0.13 * k) for k in range(KILLS)]
    return [
        Figure("recorder_message", cost, "µs", "JointState by mcap_ros2", mcap_ros2_cost_us(cycles)),
        Figure("recorder_kill_loss", max(losses), "ms", f"promised, worst of {KILLS} kills", 100.0),
    ]
