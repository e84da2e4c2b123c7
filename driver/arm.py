"""`ArmLoop`: the handle through which the rest of the house commands the cyclic loop, which runs in a process alone."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from config import InputError, Installation
from config.schema import Mode
from driver.cyclic.messages import Reply, Request, Start, Verb, plan_to_memory, receive, send
from driver.cyclic.status import LoopStatus
from driver.plan import Plan

STATUS_TIMEOUT_S = 5.0
EXIT_TIMEOUT_S = 20.0
EXIT_CODE_S = 1.0


class ArmLoop:
    """Handle of the running loop. Thread-safe: a `stop` overtakes an `enable` that still waits.

    Every method raises InputError with one sentence when the loop refuses, or when its process is gone. When the
    holder of the handle dies, the loop notices, stops the arm, disables the drives and ends.
    """

    def __init__(self, process: subprocess.Popen[bytes], connection: socket.socket) -> None:
        self._process = process
        self._connection = connection
        self._sending = threading.Lock()
        self._waiting: dict[int, tuple[Future[Any], Callable[[str], None] | None]] = {}
        self._number = 0
        self._gone = False
        self._listener = threading.Thread(target=self._listen, name="arm-loop-replies", daemon=True)
        self._listener.start()

    @classmethod
    def start(
        cls,
        installation: Installation,
        *,
        lockstep: bool,
        ring_name: str,
        progress: Callable[[str], None] | None = None,
    ) -> ArmLoop:
        """Spawn the loop, commission all drives and sensors, begin cycling with the drives not enabled.

        Raises InputError with one sentence when a bus, drive or sensor is not as configured; nothing is left running.
        """
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-m", "driver.cyclic.process", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                # A Ctrl-C at the terminal is for the daemon, which stops the loop in order.
                start_new_session=True,
            )
        arm = cls(process, ours)
        try:
            arm._ask("start", Start(installation, lockstep, ring_name), progress=progress)
        except BaseException:
            arm.close()
            raise
        return arm

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def alive(self) -> bool:
        return not self._gone and self._process.poll() is None

    def status(self) -> LoopStatus:
        """The loop now. Raises InputError when it does not answer within five seconds."""
        status: LoopStatus = self._ask("status", timeout=STATUS_TIMEOUT_S)
        return status

    def enable(self, mode: Mode) -> None:
        """Enable all drives in ``mode`` (re-mapping them when they are commissioned for the other) and hold the
        measured position; returns when the arm holds."""
        self._ask("enable", mode)

    def disable(self) -> None:
        """From holding: brakes and drives off in order; returns when all drives are off."""
        self._ask("disable")

    def play(self, plan: Plan) -> int:
        """Begin to play ``plan`` from where the arm holds; returns the run's number at once.

        Refused, with nothing moved, when the plan leaves a limit, is for another mode than the enabled one,
        or starts elsewhere than the arm holds.
        """
        head, fd = plan_to_memory(plan)
        try:
            run: int = self._ask("play", head, fds=(fd,))
        finally:
            os.close(fd)
        return run

    def wait(self, run: int, poll_s: float = 0.02, told: Callable[[LoopStatus], None] | None = None) -> LoopStatus:
        """Wait until the run of that number has ended; the status then tells its outcome. ``told`` hears each."""
        wake = threading.Event()
        while True:
            status = self.status()
            if told is not None:
                told(status)
            if status.last_run != run or status.run_outcome is not None:
                return status
            wake.wait(poll_s)

    def run_for(self, seconds: float) -> None:
        """Let that much of the loop's time pass (in lockstep, time stands while there is nothing to do)."""
        self._ask("run_for", seconds)

    def stop(self, cause: str) -> None:
        """Stop all axes now; returns when the arm is at rest with its drives off. Latches ``cause``."""
        self._ask("stop", cause)

    def reset(self) -> None:
        """Acknowledge a latched fault: clear the drives' faults, back to idle; raises InputError when one stays."""
        self._ask("reset")

    def close(self) -> None:
        """Bring the arm to rest, disable the drives, end the process. Harmless when it is already gone."""
        if self._process.poll() is None:
            try:
                self._ask("close", timeout=EXIT_TIMEOUT_S)
            except InputError:
                # It would not answer: the end of the conversation is the same request, and SIGTERM the last.
                self._process.terminate()
        self._connection.close() if self._gone else self._connection.shutdown(socket.SHUT_WR)
        try:
            self._process.wait(EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join()
        self._connection.close()

    def __enter__(self) -> ArmLoop:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(
        self,
        verb: Verb,
        argument: Any = None,
        *,
        fds: tuple[int, ...] = (),
        timeout: float | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Any:
        answer: Future[Any] = Future()
        with self._sending:
            if self._gone:
                raise self._ended()
            self._number += 1
            number = self._number
            self._waiting[number] = answer, progress
            try:
                send(self._connection, Request(number, verb, argument), fds)
            except OSError:
                del self._waiting[number]
                raise self._ended() from None
        try:
            return answer.result(timeout)
        except TimeoutError:
            self._waiting.pop(number, None)
            raise InputError("cyclic loop", f"has not answered {verb} within {timeout:g} s", "see its log") from None

    def _listen(self) -> None:
        while True:
            try:
                got = receive(self._connection)
            except OSError:
                got = None
            if got is None:
                break
            self._deliver(got[0])
        self._process.wait()
        with self._sending:
            self._gone = True
            waiting, self._waiting = self._waiting, {}
        for answer, _ in waiting.values():
            answer.set_exception(self._ended())

    def _deliver(self, reply: Reply) -> None:
        answer, progress = self._waiting.get(reply.number, (None, None))
        if answer is None:
            return
        if reply.progress is not None:
            if progress is not None:
                progress(reply.progress)
            return
        del self._waiting[reply.number]
        if reply.problem is not None:
            answer.set_exception(InputError(*reply.problem))
        else:
            answer.set_result(reply.value)

    def _ended(self) -> InputError:
        # Its sockets close a moment before the kernel has its exit code.
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(EXIT_CODE_S)
        code = self._process.poll()
        how = (
            f"ended with exit code {code}" if code is not None and code >= 0 else f"was killed by signal {-(code or 0)}"
        )
        return InputError(
            "cyclic loop", f"its process {how}", "the drives stop by themselves; see the log and start again"
        )
