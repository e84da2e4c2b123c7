"""What the handle and the loop's process say to each other over their socket pair.

One SOCK_SEQPACKET packet is one pickled message; both ends are the same program and the socket has no name,
so nobody else can speak on it. A plan's arrays travel beside the message as a sealed memory file.
"""

from __future__ import annotations

import mmap
import os
import pickle
import socket
import struct
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from config import Installation
from driver.plan import Plan

Verb = Literal["start", "status", "enable", "disable", "play", "stop", "reset", "run_for", "close"]
MESSAGE_BYTES = 1 << 17
FD = struct.Struct("@i")


@dataclass(frozen=True)
class Start:
    """First message: what to be the loop of."""

    installation: Installation
    lockstep: bool
    ring_name: str


@dataclass(frozen=True)
class Request:
    """``argument``: `Start` (start), mode (enable), `PlanHead` (play), cause (stop), seconds (run_for)."""

    number: int
    verb: Verb
    argument: Any = None


@dataclass(frozen=True)
class Reply:
    """Answer to the request of that number: a value, or ``problem`` = (place, problem, remedy) of an InputError.

    ``progress`` is a sentence on the way; more follows.
    """

    number: int
    value: Any = None
    problem: tuple[str, str, str] | None = None
    progress: str | None = None


@dataclass(frozen=True)
class PlanHead:
    """A plan without its arrays, which are in the memory file: q, dq, ddq, tau_ff behind one another."""

    shape: tuple[int, int]
    mode: str
    controller: str
    controller_rate_hz: float | None
    urdf_bytes: int
    name: str


def send(connection: socket.socket, message: Request | Reply, fds: tuple[int, ...] = ()) -> None:
    """Send one message, and file descriptors with it. Raises OSError when the other side has gone."""
    data = pickle.dumps(message)
    if fds:
        socket.send_fds(connection, [data], fds)
    else:
        connection.send(data)


def receive(connection: socket.socket, flags: int = 0) -> tuple[Any, list[int]] | None:
    """The next message and the file descriptors that came with it; None at the end of the conversation.

    Raises BlockingIOError when ``flags`` has MSG_DONTWAIT and there is none.
    """
    # Not socket.recv_fds: it drops its flags.
    data, ancillary, _, _ = connection.recvmsg(MESSAGE_BYTES, socket.CMSG_SPACE(FD.size), flags)
    fds = [
        FD.unpack(value)[0]
        for level, kind, value in ancillary
        if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS and len(value) == FD.size
    ]
    return (pickle.loads(data), fds) if data else None


def plan_to_memory(plan: Plan) -> tuple[PlanHead, int]:
    """The plan's head, and a file descriptor of the memory that holds its arrays and its URDF."""
    urdf = (plan.urdf or "").encode()
    fd = os.memfd_create("etude-plan")
    with os.fdopen(os.dup(fd), "wb") as memory:
        for array in plan.arrays:
            memory.write(array.data)
        memory.write(urdf)
    shape = (plan.samples, plan.arrays[0].shape[1])
    return PlanHead(shape, plan.mode, plan.controller, plan.controller_rate_hz, len(urdf), plan.name), fd


def plan_from_memory(head: PlanHead, fd: int) -> Plan:
    """The plan back, its arrays mapped and not copied. Takes the file descriptor over."""
    try:
        memory = mmap.mmap(fd, 0, prot=mmap.PROT_READ)
    finally:
        os.close(fd)
    samples, joints = head.shape
    arrays = np.frombuffer(memory, dtype=np.float64, count=4 * samples * joints).reshape(4, samples, joints)
    urdf = memory[arrays.nbytes : arrays.nbytes + head.urdf_bytes].decode()
    return Plan(
        arrays[0],
        arrays[1],
        arrays[2],
        arrays[3],
        mode=head.mode,  # type: ignore[arg-type]
        controller=head.controller,  # type: ignore[arg-type]
        controller_rate_hz=head.controller_rate_hz,
        urdf=urdf or None,
        name=head.name,
    )
