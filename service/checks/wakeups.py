"""Trial of punctuality: asks for real-time operation as the cyclic loop does, then measures its own wake-ups.

``python -m service.checks.wakeups PRIORITY PERIOD_NS`` prints one JSON object. It is a process of its own because
what it asks for (locked memory, scheduling) is for good.
"""

from __future__ import annotations

import json
import sys
import time

from driver.cyclic.realtime import become_realtime

WAKE_UPS = 500


def main(priority: int, period_ns: int) -> None:
    report = become_realtime(priority)
    lateness_ns = []
    due = time.monotonic_ns() + period_ns
    for _ in range(WAKE_UPS):
        pause = due - time.monotonic_ns()
        if pause > 0:
            time.sleep(pause / 1e9)
        now = time.monotonic_ns()
        lateness_ns.append(now - due)
        # After a stall whole periods are skipped, as in the loop.
        due += period_ns * max(1, -(-(now - due) // period_ns))
    lateness_ns.sort()
    print(
        json.dumps(
            {
                "scheduling": report.scheduling,
                "memory_locked": report.memory_locked,
                "refused": report.refused,
                "p99_us": lateness_ns[int(0.99 * WAKE_UPS)] / 1e3,
                "worst_us": lateness_ns[-1] / 1e3,
            }
        )
    )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
