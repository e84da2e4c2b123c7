"""Estimation in a process of its own, so that the daemon answers its clients meanwhile."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from config import InputError
from driver.process_name import name_process
from service.diagnosis.request import DiagnoseRequest
from service.identification.request import LinksRequest, LoadRequest, TorqueConstantRequest

NICENESS = 10
"""Estimation must not compete with the cyclic loop for a processor."""


Request = LinksRequest | LoadRequest | DiagnoseRequest


class WorkerLost(Exception):
    """The worker's process ended without an answer."""


async def in_worker(request: Request, tell: Callable[[str, float], None]) -> dict[str, Any]:
    """The answer of `identify`, and its progress. Cancelling ends the worker.

    Raises what `identify` raises; WorkerLost when the process was killed, by the kernel's memory limit for one.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(theirs, request), name="etude-estimator", daemon=True)
    await asyncio.to_thread(process.start)
    theirs.close()
    try:
        while True:
            kind, content = await asyncio.to_thread(ours.recv)
            if kind == "progress":
                tell(*content)
            elif kind == "raised":
                raise content
            else:
                answer: dict[str, Any] = content
                return answer
    except EOFError:
        process.join()
        raise WorkerLost(f"the estimator's process ended with code {process.exitcode}") from None
    finally:
        process.terminate()
        process.join()
        ours.close()


def _work(connection: Connection, request: Request) -> None:
    name_process("etude-estimator")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    try:
        answer = _answer(request, lambda stage, share: connection.send(("progress", (stage, share))))
    except Exception as error:
        if not isinstance(error, InputError):
            error.add_note("".join(traceback.format_exception(error)))  # a traceback does not travel by itself
        connection.send(("raised", error))
    else:
        connection.send(("answer", answer))


def _answer(request: Request, tell: Callable[[str, float], None]) -> dict[str, Any]:
    """Numerical libraries are loaded here, not in the daemon."""
    if isinstance(request, TorqueConstantRequest):
        from service.identification import torque_constant

        return torque_constant.calibrate(request, tell)
    if isinstance(request, LoadRequest):
        from service.identification import loads

        return loads.identify(request, tell).answer
    if isinstance(request, DiagnoseRequest):
        from service.diagnosis import diagnosing

        return diagnosing.diagnose_recordings(request, tell).answer
    from service.identification import links

    return links.identify(request, tell).answer
