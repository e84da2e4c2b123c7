"""How late the loop wakes, beside `cyclictest` (package rt-tests) on the same machine at the same priority.

Without cyclictest (`apt-get install rt-tests`) the reference is a bare absolute-sleep loop in this process.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import time

from benchmarks.figure import Figure
from benchmarks.standin import running
from driver.cyclic.status import LATENESS_EDGES_US

SECONDS = 15


def quantile_us(counts: tuple[int, ...], share: float) -> float:
    """Quantile of a histogram with the loop's edges, linear inside a bin."""
    edges = (0, *LATENESS_EDGES_US, 2 * LATENESS_EDGES_US[-1])
    wanted, passed = share * sum(counts), 0
    for k, count in enumerate(counts):
        if count and passed + count >= wanted:
            return edges[k] + (edges[k + 1] - edges[k]) * (wanted - passed) / count
        passed += count
    return float(edges[-1])


def cyclictest_p99_us(priority: int) -> float:
    """p99 of cyclictest at 1 kHz, µs."""
    command = ["cyclictest", "-q", "-m", f"-p{priority}", "-i1000", f"-l{SECONDS * 1000}", "-h20000"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    histogram = [(int(us), int(n)) for us, n in re.findall(r"^(\d{6}) (\d{6,})", text, re.MULTILINE)]
    wanted, passed = 0.99 * sum(n for _, n in histogram), 0
    for us, n in histogram:
        passed += n
        if passed >= wanted:
            return float(us)
    return float(histogram[-1][0])


def bare_loop_p99_us() -> float:
    late, start = [], time.monotonic_ns() + 1_000_000
    for k in range(SECONDS * 1000):
        due = start + k * 1_000_000
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        late.append(time.monotonic_ns() - due)
    return sorted(late)[int(0.99 * len(late))] / 1000


def worst_stall_ms() -> float:
    """The longest that the machine holds up a program which only reads the clock: beyond what any loop on it can do."""
    worst, last = 0, time.monotonic_ns()
    end = last + SECONDS * 1_000_000_000
    while last < end:
        now = time.monotonic_ns()
        worst, last = max(worst, now - last), now
    return worst / 1e6


def measure() -> list[Figure]:
    with running("dda", lockstep=False) as (installation, loop, _):
        before = loop.status().lateness_us
        time.sleep(SECONDS)
        after = loop.status().lateness_us
    p99 = quantile_us(tuple(b - a for a, b in zip(before, after, strict=True)), 0.99)
    if shutil.which("cyclictest"):
        reference, value = "cyclictest p99", cyclictest_p99_us(max(1, installation.cycle.priority))
    else:
        reference, value = "bare sleep loop p99 (for cyclictest: apt-get install rt-tests)", bare_loop_p99_us()
    patience_ms = installation.cycle.missed_deadlines_to_stop * installation.cycle.period_ns / 1e6
    return [
        Figure("lateness_p99", p99, "µs", reference, value),
        Figure("core_stall", worst_stall_ms(), "ms", "gap that stops the arm at 1 kHz", patience_ms),
    ]
