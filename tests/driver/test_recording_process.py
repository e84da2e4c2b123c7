"""The recorder's process: follows a ring, survives its commander, and loses little when it is killed."""

from __future__ import annotations

import os
import resource
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.cyclic.ring import RingWriter
from driver.recording import RecorderProcess, read_recording, recover

CycleMaker = Callable[..., list[Cycle]]
RingMaker = Callable[[bool], RingWriter]


@pytest.fixture
def ring_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dda: Installation) -> Iterator[RingMaker]:
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path / "run"))
    rings = []

    def make(lockstep: bool) -> RingWriter:
        ring = RingWriter("t", len(dda.joint), period_ns=1_000_000, lockstep=lockstep, slots=512)
        rings.append(ring)
        return ring

    yield make
    for ring in rings:
        ring.close()


def publish(ring: RingWriter, cycles: list[Cycle]) -> None:
    for c in cycles:
        valid = sum(ok << i for i, ok in enumerate(c.valid))
        values = (*c.q, *c.dq, *c.tau, *c.q_d, *c.dq_d, *c.tau_command, *c.tau_ff)
        frames = [(f.bus, f.sent, f.time_ns, f.data) for f in c.frames]
        ring.publish(c.index, c.time_ns, 0, int(c.state), c.run, valid, values, None, frames, c.serial, c.events)


def wait_for(what: Callable[[], bool], timeout_s: float = 20.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not what():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.01)


def test_a_run_has_the_cycles_between_start_and_stop(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    """In lockstep exactly those, more than the ring holds, and the same bytes every time."""
    cycles = make_cycles(dda, 1500)
    ring = ring_of(True)
    with RecorderProcess.start(dda, "t", tmp_path / "out") as recorder:
        files = []
        for _ in range(2):
            publish(ring, cycles[:100])
            path = recorder.start_run("motion", metadata={"mode": "csp"})
            publish(ring, cycles[100:1400])
            assert recorder.stop_run() == path
            publish(ring, cycles[1400:])
            files.append(path)
        assert recorder.status().path is None
    assert [f.name for f in files] == ["motion.mcap", "motion-2.mcap"]
    assert files[0].read_bytes() == files[1].read_bytes()
    recording = read_recording(files[0])
    assert np.array_equal(recording.q, [c.q for c in cycles[100:1400]])
    assert recording.gaps == ()


def test_cycles_that_the_loop_overwrote_are_noted(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    """On the wall clock the loop does not wait: a recorder that stalls leaves a gap with its size in /events."""
    ring = ring_of(False)
    cycles = make_cycles(dda, 1200)
    with RecorderProcess.start(dda, "t", tmp_path) as recorder:
        path = recorder.start_run("motion")
        publish(ring, cycles[:10])
        wait_for(lambda: recorder.status().cycles == 10)
        assert recorder.pid is not None
        os.kill(recorder.pid, signal.SIGSTOP)
        publish(ring, cycles[10:])
        os.kill(recorder.pid, signal.SIGCONT)
        recorder.stop_run()
    recording = read_recording(path)
    lost = 1200 - len(recording.t)
    assert lost > 600
    assert [e.text for e in recording.events if "lost" in e.text] == [
        f"recorder: {lost} cycles were lost, the disk was too slow"
    ]
    assert len(recording.gaps) == 1


def test_a_killed_recorder_leaves_all_but_the_last_chunk(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    ring = ring_of(False)
    recorder = RecorderProcess.start(dda, "t", tmp_path)
    try:
        path = recorder.start_run("motion")
        cycles = make_cycles(dda, 900)
        for first in range(0, 900, 100):
            publish(ring, cycles[first : first + 100])
            wait_for(lambda first=first: recorder.status().cycles == first + 100)  # type: ignore[misc]
        assert recorder.pid is not None
        os.kill(recorder.pid, signal.SIGKILL)
        with pytest.raises(InputError, match="recorder: its process is gone"):
            recorder.stop_run()
    finally:
        recorder.close()
    with pytest.raises(InputError, match="run: etude recover"):
        read_recording(path)
    recover(path)
    t = read_recording(path).t
    assert t[-1] >= 0.9 - 0.1


def test_silence_of_the_loop_brings_everything_to_disk(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    """On the wall clock, when the loop is gone, what it published last does not wait for a chunk to fill."""
    ring = ring_of(False)
    with RecorderProcess.start(dda, "t", tmp_path) as recorder:
        path = recorder.start_run("motion")
        publish(ring, make_cycles(dda, 10))
        copy = tmp_path / "copy.mcap"

        def everything_is_there() -> bool:
            copy.write_bytes(path.read_bytes())
            return recover(copy).messages > 0

        wait_for(everything_is_there)
        assert len(read_recording(copy).t) == 10


def test_the_file_is_completed_when_the_commander_goes(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    ring = ring_of(False)
    recorder = RecorderProcess.start(dda, "t", tmp_path)
    path = recorder.start_run("motion")
    publish(ring, make_cycles(dda, 25))
    recorder.close()
    assert len(read_recording(path).t) == 25


def test_sigterm_completes_the_file(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    ring = ring_of(False)
    recorder = RecorderProcess.start(dda, "t", tmp_path)
    path = recorder.start_run("motion")
    publish(ring, make_cycles(dda, 25))
    assert recorder.pid is not None
    os.kill(recorder.pid, signal.SIGTERM)
    recorder.close()
    assert len(read_recording(path).t) == 25


def test_what_the_recorder_refuses_is_one_sentence(tmp_path: Path, dda: Installation, ring_of: RingMaker) -> None:
    with pytest.raises(InputError, match="ring nobody: no loop is running under this name"):
        RecorderProcess.start(dda, "nobody", tmp_path)
    ring_of(False)
    (tmp_path / "file").write_text("")
    with RecorderProcess.start(dda, "t", tmp_path) as recorder:
        with pytest.raises(InputError, match="is not recording; start a run first"):
            recorder.stop_run()
        with pytest.raises(InputError, match="'a/b' cannot name a file"):
            recorder.start_run("a/b")
        with pytest.raises(InputError, match=r"file: cannot be made"):
            recorder.start_run("a", tmp_path / "file")
        with pytest.raises(InputError, match=r"model\.toml: cannot be read"):
            recorder.start_run("a", attach=(tmp_path / "model.toml",))
        recorder.start_run("a")
        with pytest.raises(InputError, match=r"already recording .*a\.mcap; stop that run first"):
            recorder.start_run("b")
    assert sorted(p.name for p in tmp_path.glob("*.mcap")) == ["a.mcap"]


def test_a_full_disk_stops_the_recording_and_nothing_else(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, ring_of: RingMaker
) -> None:
    """A limit on the size of its files stands for the disk: the loop goes on, the file can be recovered."""
    ring = ring_of(False)
    with RecorderProcess.start(dda, "t", tmp_path) as recorder:
        assert recorder.pid is not None
        path = recorder.start_run("motion")
        resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (70_000, resource.RLIM_INFINITY))
        for _ in range(4):
            publish(ring, make_cycles(dda, 200))
            wait_for(lambda: recorder.status().problem is not None or recorder.status().cycles > 0)
        wait_for(lambda: recorder.status().problem is not None)
        with pytest.raises(InputError, match=r"motion\.mcap: could not be written to its end \(File too large\)"):
            recorder.stop_run()
        resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        again = recorder.start_run("motion")
        publish(ring, make_cycles(dda, 30))
        recorder.stop_run()
    assert len(read_recording(again).t) == 30
    recover(path)
    assert len(read_recording(path).t) > 20
