"""Whether this machine lets the cyclic loop be punctual: asked for in a process of its own, then measured there."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from config import Installation
from service.checks.finding import Finding

AREA = "real time"
LATE_SHARE = 0.25
"""The loop counts a cycle as missed when it wakes later than this share of its period."""
TIMEOUT_S = 30.0


def check_realtime(installation: Installation) -> Iterator[Finding]:
    """Scheduling, memory locking, timers as granted to this user; kernel preemption; measured wake-up lateness."""
    try:
        run = subprocess.run(
            [
                sys.executable,
                "-m",
                "service.checks.wakeups",
                str(installation.cycle.priority),
                str(installation.cycle.period_ns),
            ],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=True,
        )
        found = json.loads(run.stdout)
    except (subprocess.SubprocessError, json.JSONDecodeError) as error:
        yield Finding(AREA, "trial", "fail", f"the trial process failed ({error})", "see its message above")
        return
    refused = found["refused"]
    granted = f"{found['scheduling']}, memory {'locked' if found['memory_locked'] else 'not locked'}"
    yield Finding(AREA, "scheduling", "warn" if refused else "ok", granted, "; ".join(refused))
    kernel = preemption()
    yield Finding(
        AREA, "kernel preemption", "ok" if kernel in ("full", "rt") else "warn", kernel,
        "" if kernel in ("full", "rt") else "boot with preempt=full, or a PREEMPT_RT kernel",
    )  # fmt: skip
    p99, worst, period = found["p99_us"], found["worst_us"], installation.cycle.period_ns / 1e3
    detail = f"99 % of wake-ups within {p99:.0f} µs, worst {worst:.0f} µs, of a period of {period:.0f} µs"
    if p99 > LATE_SHARE * period:
        yield Finding(
            AREA, "lateness", "warn", detail, "grant real-time scheduling, or lower rate_hz, or unload the machine"
        )
    else:
        yield Finding(AREA, "lateness", "ok", detail)


def preemption() -> str:
    """The kernel's preemption model: "rt", "full", "lazy", "voluntary", "none", or "unknown"."""
    realtime = Path("/sys/kernel/realtime")
    version = Path("/proc/version").read_text()
    if (realtime.exists() and realtime.read_text().strip() == "1") or "PREEMPT_RT" in version:
        return "rt"
    try:
        # The chosen model stands in brackets: "none voluntary (full)".
        choices = Path("/sys/kernel/debug/sched/preempt").read_text()
        return choices.split("(")[1].split(")")[0]
    except (OSError, IndexError):
        pass
    if "PREEMPT_DYNAMIC" in version:
        return next(
            (w.split("=")[1] for w in Path("/proc/cmdline").read_text().split() if w.startswith("preempt=")), "unknown"
        )
    return "full" if " PREEMPT " in version else "unknown"
