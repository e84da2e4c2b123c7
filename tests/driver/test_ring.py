"""The ring: what goes in comes out, overtaken readers are told, and nobody ever reads half a cycle."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config import InputError
from driver.cyclic.cycle import LoopState, WrenchSample
from driver.cyclic.ring import RingReader, RingWriter, ring_path
from driver.cyclic.slot import TAIL_BYTES, Batch

FRAME = bytes(range(16))


@pytest.fixture
def name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path))
    yield "ring-under-test"
    ring_path("ring-under-test").unlink(missing_ok=True)


def publish(writer: RingWriter, k: int, joints: int = 2, frames: list[Batch] | None = None, **rest: object) -> None:
    writer.publish(
        k, 10 * k, -k, LoopState.PLAYING, 3, 0b01, [k + i / 100 for i in range(7 * joints)], None, frames or [],
        **rest,  # type: ignore[arg-type]
    )  # fmt: skip


def test_a_cycle_comes_back_whole(name: str) -> None:
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=False)
    reader = RingReader(name)
    wrench = WrenchSample((1.0, -2.0, 3.0, 0.1, 0.2, -0.3), 5, 77, True)
    values = [float(i) for i in range(14)]
    values[1] = math.nan
    batches = [(0, True, 5, FRAME), (1, False, 6, FRAME + FRAME[::-1])]
    writer.publish(9, 123, 45, LoopState.HOLDING, 0, 0b10, values, wrench, batches, [(2, b"abc")], ["stopped: α"])
    lost, (cycle,) = reader.cycles()
    assert lost == 0
    assert (cycle.index, cycle.time_ns, cycle.late_ns, cycle.state) == (9, 123, 45, LoopState.HOLDING)
    assert cycle.valid == (False, True)
    assert cycle.q[0] == 0.0 and math.isnan(cycle.q[1])
    columns = (cycle.dq, cycle.tau, cycle.q_d, cycle.dq_d, cycle.tau_command, cycle.tau_ff)
    assert columns == tuple((2.0 * k, 2.0 * k + 1) for k in range(1, 7))
    assert cycle.wrench == wrench
    assert [(f.bus, f.sent, f.time_ns, f.data) for f in cycle.frames] == [
        (0, True, 5, FRAME),
        (1, False, 6, FRAME),
        (1, False, 6, FRAME[::-1]),
    ]
    assert cycle.serial == ((2, b"abc"),)
    assert cycle.events == ("stopped: α",)
    reader.close()
    writer.close()


def test_an_overtaken_reader_is_told_exactly_how_much_it_lost(name: str) -> None:
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=False, slots=64)
    slow, quick = RingReader(name), RingReader(name)
    seen: list[int] = []
    for k in range(1000):
        publish(writer, k)
        lost, cycles = quick.cycles()
        assert lost == 0
        seen += [c.index for c in cycles]
    assert seen == list(range(1000))
    lost, cycles = slow.cycles()
    assert lost > 0
    indices = [c.index for c in cycles]
    assert indices == list(range(lost, 1000))
    assert slow.lost == lost
    for reader in (slow, quick):
        reader.close()
    writer.close()


@settings(max_examples=40, deadline=None)
@given(
    cycles=st.lists(
        st.tuples(
            st.lists(st.integers(0, TAIL_BYTES // 16 + 40), max_size=4),
            st.lists(st.integers(0, 3 * TAIL_BYTES), max_size=3),
            st.lists(st.text(max_size=300), max_size=4),
        ),
        max_size=8,
    )
)
def test_a_burst_is_spread_over_slots_and_nothing_of_it_is_dropped(
    cycles: list[tuple[list[int], list[int], list[str]]],
) -> None:
    name = "ring-burst"
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=False, slots=128)
    reader = RingReader(name)
    frames, serial, events, number = b"", b"", list[str](), 0
    for k, (batch_sizes, line_sizes, sentences) in enumerate(cycles):
        batches, lines = [], []
        for size in batch_sizes:
            data = b"".join((number + i).to_bytes(16, "little") for i in range(size))
            number += size
            batches.append((0, False, k, data))
            frames += data
        for size in line_sizes:
            data = bytes((k + i) % 256 for i in range(size))
            lines.append((0, data))
            serial += data
        events += sentences
        publish(writer, k, frames=batches, serial=lines, events=sentences)
    for k in range(60):
        publish(writer, len(cycles) + k)
    _, read = reader.cycles(limit=10_000)
    assert b"".join(f.data for c in read for f in c.frames) == frames
    assert b"".join(data for c in read for _, data in c.serial) == serial
    assert [e for c in read for e in c.events] == events
    reader.close()
    writer.close()


def test_a_reader_racing_the_producer_never_sees_a_torn_cycle(name: str) -> None:
    script = textwrap.dedent(
        """
        import sys
        from driver.cyclic.ring import RingWriter
        writer = RingWriter(sys.argv[1], 7, period_ns=1, lockstep=False, slots=16)
        print("ready", flush=True)
        sys.stdin.readline()
        for k in range(20_000):
            writer.publish(k, k, k, 4, k, 1, [float(k)] * 49, None, [])
        sys.stdin.readline()
        """
    )
    child = subprocess.Popen(
        [sys.executable, "-c", script, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdin is not None and child.stdout is not None
    with child:
        assert child.stdout.readline() == "ready\n"
        reader = RingReader(name)
        child.stdin.write("go\n")
        child.stdin.flush()
        seen = lost = 0
        while seen + lost < 20_000:
            gone, cycles = reader.cycles()
            lost += gone
            for cycle in cycles:
                k = cycle.index
                assert cycle.time_ns == cycle.late_ns == cycle.run == k
                assert set(cycle.q + cycle.tau_ff + cycle.dq_d) == {float(k)}
            if cycles:
                assert [c.index for c in cycles] == list(range(seen + lost, seen + lost + len(cycles)))
            seen += len(cycles)
        assert seen > 0
        child.stdin.write("done\n")
        child.stdin.flush()
    reader.close()
    ring_path(name).unlink(missing_ok=True)


def test_in_lockstep_the_producer_waits_for_the_recorder_and_nothing_is_lost(name: str) -> None:
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=True, slots=32)
    reader = RingReader(name)
    reader.register_recorder()
    producer = threading.Thread(target=lambda: [publish(writer, k) for k in range(500)])
    producer.start()
    seen: list[int] = []
    while len(seen) < 500:
        lost, cycles = reader.cycles(limit=10)
        assert lost == 0
        seen += [c.index for c in cycles]
    producer.join()
    assert seen == list(range(500))
    reader.close()
    writer.close()


def test_a_killed_recorder_does_not_hold_lockstep_up(name: str) -> None:
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=True, slots=32)
    script = (
        "import sys, time\nfrom driver.cyclic.ring import RingReader\n"
        "r = RingReader(sys.argv[1]); r.register_recorder(); print('ready', flush=True); time.sleep(60)"
    )
    recorder = subprocess.Popen([sys.executable, "-c", script, name], stdout=subprocess.PIPE)
    assert recorder.stdout is not None
    with recorder:
        assert recorder.stdout.readline()
        os.kill(recorder.pid, signal.SIGKILL)
    for k in range(100):
        publish(writer, k)
    assert writer.head == 100
    writer.close()


def test_readers_learn_that_the_producer_ended_or_was_killed(name: str) -> None:
    writer = RingWriter(name, 2, period_ns=1_000_000, lockstep=False)
    reader = RingReader(name)
    publish(writer, 0)
    assert not reader.ended
    writer.close()
    assert reader.ended
    assert [c.index for c in reader.cycles()[1]] == [0]
    reader.close()

    script = (
        "import os, signal, sys\nfrom driver.cyclic.ring import RingWriter\n"
        "w = RingWriter(sys.argv[1], 2, period_ns=1, lockstep=False)\n"
        "w.publish(7, 7, 7, 4, 0, 3, [0.0] * 14, None, [])\nprint('ready', flush=True); sys.stdin.read()"
    )
    producer = subprocess.Popen([sys.executable, "-c", script, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert producer.stdout is not None
    with producer:
        producer.stdout.readline()
        reader = RingReader(name, from_start=True)
        assert not reader.ended
        os.kill(producer.pid, signal.SIGKILL)
    assert reader.ended
    assert [c.index for c in reader.cycles()[1]] == [7]
    latest = reader.latest()
    assert latest is not None and latest.index == 7
    reader.close()


def test_no_loop_is_one_sentence(name: str) -> None:
    with pytest.raises(InputError, match="no loop is running"):
        RingReader(name)
    ring_path(name).write_bytes(bytes(8192))
    with pytest.raises(InputError, match="not a ring"):
        RingReader(name)
