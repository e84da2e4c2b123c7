"""What `ps` and `top` call a process that was started for one piece of work."""

from __future__ import annotations

from pathlib import Path

LONGEST = 15
"""Bytes that the kernel keeps of a name (TASK_COMM_LEN less its zero)."""


def name_process(name: str) -> None:
    """Name the calling process; of ``name`` the first `LONGEST` bytes are kept. For its main thread to call."""
    Path("/proc/self/comm").write_text(name[:LONGEST])
