"""Tells the service manager how we are: sd_notify(3) in plain socket code.

The same datagrams serve `etude up` and `etude demo`, which supervise their processes as systemd would.
"""

from __future__ import annotations

import os
import socket


def notify(*assignments: str) -> bool:
    """Send ``NAME=value`` assignments to the service manager; False when nobody listens ($NOTIFY_SOCKET unset or gone).

    Losing a notification must never stop the arm's service, so a vanished manager is not an error.
    """
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return False
    target: str | bytes = b"\0" + address[1:].encode() if address.startswith("@") else address
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK) as line:
        try:
            line.sendto("\n".join(assignments).encode(), target)
        except OSError:
            return False
    return True


def watchdog_interval_s() -> float | None:
    """Seconds within which the manager wants a sign of life, or None when it wants none of this process."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    meant_for = os.environ.get("WATCHDOG_PID", "")
    if not microseconds.isdigit() or (meant_for and meant_for != str(os.getpid())):
        return None
    return int(microseconds) / 1e6 or None
