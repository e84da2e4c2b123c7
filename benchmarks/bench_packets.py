"""What passing a packet to another process and back costs, whatever is done with it: the floor below lockstep.

Across cores a process that waits must be woken; on one core the other is only switched to, but nothing overlaps.
"""

from __future__ import annotations

import multiprocessing
import os
import socket
import time

from benchmarks.figure import Figure

ROUND_TRIPS, BATCHES = 500, 10
PACKET = bytes(64)


def echo(end: socket.socket, core: int) -> None:
    os.sched_setaffinity(0, {core})
    for _ in range(ROUND_TRIPS * BATCHES):
        end.send(end.recv(4096))


def round_trip_us(ours: int, theirs: int) -> float:
    """The best batch's mean time of a packet to a process on core ``theirs`` and back, µs."""
    allowed = os.sched_getaffinity(0)
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    peer = multiprocessing.get_context("fork").Process(target=echo, args=(far, theirs))
    peer.start()
    os.sched_setaffinity(0, {ours})
    best = float("inf")
    for _ in range(BATCHES):
        start = time.perf_counter()
        for _ in range(ROUND_TRIPS):
            near.send(PACKET)
            near.recv(4096)
        best = min(best, (time.perf_counter() - start) / ROUND_TRIPS * 1e6)
    os.sched_setaffinity(0, allowed)
    peer.join(10)
    return best


def measure() -> list[Figure]:
    cores = sorted(os.sched_getaffinity(0))
    one, other = cores[0], cores[-1]
    return [Figure("packet_round_trip", round_trip_us(one, other), "µs", "on one core", round_trip_us(one, one))]
