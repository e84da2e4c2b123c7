"""The loop's process: commissions, cycles, answers its handle, and brings the arm to rest before it ends.

Whatever ends the conversation (a close, SIGTERM, the death of the handle's process) leads to the same way out:
stop all axes, disable the drives, leave the buses.
"""

from __future__ import annotations

import select
import signal
import socket
import sys
import traceback
from collections.abc import Callable
from types import FrameType

from config import InputError
from driver.cyclic.commanding import Answer
from driver.cyclic.cycle import LoopState
from driver.cyclic.loop import CyclicLoop
from driver.cyclic.messages import Reply, Request, Start, plan_from_memory, receive, send
from driver.cyclic.realtime import become_realtime
from driver.cyclic.ring import RingWriter

CLOSING_S = 12.0
"""Longest time for the way out, of the loop's own time; the drives stop by themselves when it is not enough."""


class LoopProcess:
    """Serves one handle over its socket pair until either side ends it."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._poll = select.poll()
        self._poll.register(connection.fileno(), select.POLLIN)
        self._ending: str | None = None
        self._close_request: int | None = None
        self._answered: list[Reply] = []
        signal.signal(signal.SIGTERM, self._terminated)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def run(self) -> int:
        """The exit code: 0, or 1 when the loop itself failed."""
        got = receive(self._connection)
        if got is None:
            return 0
        request: Request = got[0]
        start: Start = request.argument
        try:
            loop = self._start(request.number, start)
        except InputError as problem:
            self._reply(Reply(request.number, problem=(problem.place, problem.problem, problem.remedy)))
            return 0
        try:
            self._serve(loop)
            return 0
        except Exception:
            traceback.print_exc()
            self._last_stop(loop)
            return 1
        finally:
            self._send_answers()
            loop.close()
            loop.ring.close()
            if self._close_request is not None:
                self._reply(Reply(self._close_request))

    def _start(self, number: int, start: Start) -> CyclicLoop:
        installation = start.installation
        ring = RingWriter(
            start.ring_name,
            len(installation.joint),
            period_ns=installation.cycle.period_ns,
            lockstep=start.lockstep,
        )
        try:
            realtime = become_realtime(0 if start.lockstep else installation.cycle.priority)
            loop = CyclicLoop(
                installation,
                lockstep=start.lockstep,
                ring=ring,
                realtime=realtime,
                progress=self._progress(number),
            )
        except BaseException:
            ring.close()
            raise
        self._reply(Reply(number))
        return loop

    def _serve(self, loop: CyclicLoop) -> None:
        while self._ending is None:
            if not loop.connected or (loop.lockstep and not loop.busy):
                # Virtual time stands still while nothing is to be done, so that a run depends on its requests alone.
                self._poll.poll(500)
            self._take_requests(loop)
            if loop.connected and (loop.busy or not loop.lockstep):
                loop.cycle()
            self._send_answers()
        self._way_out(loop, self._ending)

    def _way_out(self, loop: CyclicLoop, cause: str) -> None:
        if not loop.connected:
            return
        machine = loop.machine
        cycles = int(CLOSING_S * loop.installation.cycle.rate_hz)
        if machine.state is LoopState.HOLDING:
            machine.disable(lambda _: None)
        elif machine.state not in (LoopState.IDLE, LoopState.LATCHED):
            machine.stop(cause)
        while machine.state not in (LoopState.IDLE, LoopState.LATCHED) and cycles > 0:
            loop.cycle()
            cycles -= 1
        loop.cycle()

    def _last_stop(self, loop: CyclicLoop) -> None:
        """The loop itself has failed: try the way out once more, else silence lets the drives stop by themselves."""
        try:
            loop.machine.stop("the loop failed; see its log")
            self._way_out(loop, "the loop failed; see its log")
        except Exception:
            traceback.print_exc()

    def _take_requests(self, loop: CyclicLoop) -> None:
        while self._poll.poll(0):
            try:
                got = receive(self._connection, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:
                got = None
            if got is None:
                self._ending = self._ending or "the daemon has gone"
                return
            request, fds = got
            try:
                self._act(loop, request, fds)
            except InputError as problem:
                self._reply(Reply(request.number, problem=(problem.place, problem.problem, problem.remedy)))

    def _act(self, loop: CyclicLoop, request: Request, fds: list[int]) -> None:
        number, argument, answer = request.number, request.argument, self._answer(request.number)
        match request.verb:
            case "status":
                self._reply(Reply(number, loop.status()))
            case "enable":
                loop.enable(argument, answer, self._progress(number))
            case "disable":
                loop.machine.disable(answer)
            case "play":
                self._reply(Reply(number, loop.play(plan_from_memory(argument, fds[0]))))
            case "stop":
                loop.machine.stop(argument, answer)
            case "reset":
                loop.reset(answer, self._progress(number))
            case "run_for":
                loop.run_for(argument, answer)
            case "close":
                self._ending, self._close_request = "the daemon ends", number
            case "start":
                raise InputError("cyclic loop", "has already been started")

    def _answer(self, number: int) -> Answer:
        def answer(problem: InputError | None) -> None:
            detail = None if problem is None else (problem.place, problem.problem, problem.remedy)
            self._answered.append(Reply(number, problem=detail))

        return answer

    def _send_answers(self) -> None:
        """What a cycle answered is told when the cycle is in the ring, so that who is answered can read it there."""
        for reply in self._answered:
            self._reply(reply)
        self._answered.clear()

    def _progress(self, number: int) -> Callable[[str], None]:
        return lambda sentence: self._reply(Reply(number, progress=sentence))

    def _reply(self, reply: Reply) -> None:
        try:
            send(self._connection, reply)
        except OSError:
            self._ending = self._ending or "the daemon has gone"

    def _terminated(self, _signal: int, _frame: FrameType | None) -> None:
        self._ending = self._ending or "the loop was told to end (SIGTERM)"


def main() -> int:
    """Entry of ``python -m driver.cyclic.process FD``."""
    with socket.socket(fileno=int(sys.argv[1])) as connection:
        return LoopProcess(connection).run()


if __name__ == "__main__":
    sys.exit(main())
