"""One daemon an arm: an flock that dies with its holder."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from config import InputError


class ArmLock:
    """Holds ``<run directory>/<arm>.lock`` until `release` or the end of the process.

    Raises InputError naming the holder's process when another one holds it.
    """

    def __init__(self, run: Path, arm: str) -> None:
        self.path = run / f"{arm}.lock"
        try:
            self._fd = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o660)
        except PermissionError:
            raise InputError(
                str(self.path),
                "this user may not write the daemon's lock",
                "run as the service's user, or set ETUDE_RUN",
            ) from None
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(self._fd, 32, 0).decode(errors="replace").strip() or "unknown"
            os.close(self._fd)
            raise InputError(
                f"arm {arm}",
                f"another etude daemon (process {holder}) already serves this arm",
                "stop that one first, or use it: etude status",
            ) from None
        os.ftruncate(self._fd, 0)
        os.pwrite(self._fd, f"{os.getpid()}\n".encode(), 0)

    def release(self) -> None:
        """Give the arm up. The file stays: removing it would let two daemons lock two different files."""
        os.ftruncate(self._fd, 0)
        os.close(self._fd)
