"""Starts Étude's processes and knows when they are ready, as systemd would: by their sd_notify messages."""

from __future__ import annotations

import ctypes
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence

from service.outcomes import DEFECT

STOP_TIMEOUT_S = 30.0
"""Longest an orderly end may take: the damped stop, the drives' disabling, the files' closing."""
PR_SET_PDEATHSIG = 1


class StartFailed(Exception):
    """A process ended, or said nothing, before it was ready. ``code`` is what the command should exit with;
    the process has said the reason on standard error itself."""

    def __init__(self, message: str, code: int) -> None:
        self.code = code
        super().__init__(message)


class SupervisedProcess:
    """`etude <arguments>` as a child process in a process group of its own, so that Ctrl-C at the terminal reaches
    the supervisor alone, who ends everything in order. If the supervisor dies, the kernel sends the child SIGTERM.

    What the child prints goes to standard error, or to ``log`` (a file descriptor).
    """

    def __init__(
        self, arguments: Sequence[str], environment: Mapping[str, str] | None = None, log: int | None = None
    ) -> None:
        self.name = arguments[0]
        # An abstract address of the kernel's choosing: nothing to name, nothing to remove.
        self._notices = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._notices.bind("")
        address = "@" + self._notices.getsockname()[1:].decode()
        output = sys.stderr.fileno() if log is None else log
        self.process = subprocess.Popen(
            [sys.executable, "-m", "service", *arguments],
            env={**os.environ, **(environment or {}), "NOTIFY_SOCKET": address},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            preexec_fn=_die_with_parent,
        )

    def wait_ready(self, timeout_s: float) -> None:
        """Return when the process has said READY=1. Raises StartFailed when it ends or stays silent."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            readable, _, _ = select.select([self._notices], [], [], min(left, 0.1))
            if readable and b"READY=1" in self._notices.recv(4096).split(b"\n"):
                return
            if not readable and (code := self.process.poll()) is not None:
                raise StartFailed(f"etude {self.name} ended before it was ready", code if code > 0 else DEFECT)
        raise StartFailed(f"etude {self.name} was not ready within {timeout_s:g} s", DEFECT)

    def stop(self) -> int:
        """End the process in order and return its exit code; killed only when it does not end by itself."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            code = self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = self.process.wait()
        self._notices.close()
        return code


_libc = ctypes.CDLL(None, use_errno=True)


def _die_with_parent() -> None:
    # Between fork and exec: no allocation, no import, one system call.
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
