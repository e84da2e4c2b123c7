"""Asks the system for what a punctual loop needs, and reports what it got."""

from __future__ import annotations

import ctypes
import gc
import os
import sys

from driver.cyclic.status import RealtimeReport

PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_FUTURE = 1, 2
SWITCH_INTERVAL_S = 1e-4


def become_realtime(priority: int) -> RealtimeReport:
    """First in, first out at ``priority`` (0: not asked for), memory locked, timers exact, garbage collector off.

    What is refused is not an error: the loop works without, less punctually, and the report says so.
    """
    refused: list[str] = []
    libc = ctypes.CDLL(None, use_errno=True)
    slack_ns = 50_000
    if libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0:
        slack_ns = 1
    else:
        refused.append("exact timers were refused (prctl PR_SET_TIMERSLACK)")
    scheduling = "normal"
    if priority > 0:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            scheduling = f"fifo {priority}"
        except OSError as error:
            refused.append(
                f"SCHED_FIFO {priority} was refused ({error.strerror}): give the user `rtprio {priority}` in "
                "/etc/security/limits.d, or start it by the systemd unit"
            )
    locked = libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0
    if not locked:
        # A failed MCL_FUTURE must not linger: later allocations would fail instead of paging.
        libc.munlockall()
        refused.append(
            f"locking memory was refused ({os.strerror(ctypes.get_errno())}): give the user `memlock unlimited`"
        )
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.disable()
    return RealtimeReport(scheduling, locked, slack_ns, tuple(refused))
