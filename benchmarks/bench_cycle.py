"""CPU of one cycle for seven axes: the whole loop, beside a bare socket loop that passes the same bytes."""

from __future__ import annotations

import multiprocessing
import socket
import struct
import time

from benchmarks.figure import Figure
from benchmarks.standin import running
from config import Installation

SECONDS = 10.0
FRAME = struct.Struct("<IB3x8s")


def frames_a_cycle(installation: Installation) -> list[tuple[int, int]]:
    """Per bus: how many RPDOs and TPDOs a cycle carries in position mode."""
    counts = []
    for bus in installation.bus:
        layouts = [installation.drive_of(j).layouts["csp"] for j in installation.joints_on(bus)]
        counts.append((sum(len(x.rpdo) for x in layouts), sum(len(x.tpdo) for x in layouts)))
    return counts


def answer(ends: list[socket.socket], tpdos: list[int], cycles: int) -> None:
    """The other end of each bus: answers a SYNC with its TPDOs, one packet each as a paced bus delivers them."""
    for _ in range(cycles):
        for end, count in zip(ends, tpdos, strict=True):
            while end.recv(4096)[:4] != b"\x80\0\0\0":
                pass
            for k in range(count):
                end.send(FRAME.pack(0x181 + k, 8, bytes(8)))


def bare_loop_us(installation: Installation) -> float:
    """CPU µs a cycle of sleep, SYNC, sleep, drain, send: no decoding, no gate, no ring."""
    counts, period = frames_a_cycle(installation), installation.cycle.period_ns
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in counts]
    cycles = int(SECONDS * 1e9 / period)
    peer = multiprocessing.get_context("fork").Process(
        target=answer, args=([b for _, b in pairs], [t for _, t in counts], cycles)
    )
    peer.start()
    ours = [a for a, _ in pairs]
    commands = [b"".join(FRAME.pack(0x201 + k, 8, bytes(8)) for k in range(r)) for r, _ in counts]
    sync, buffer = FRAME.pack(0x80, 0, b""), bytearray(4096)
    for end in ours:
        end.setblocking(False)
    start_cpu, due = time.process_time(), time.monotonic_ns() + period
    for _ in range(cycles):
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        for end in ours:
            end.send(sync)
        time.sleep(period / 2e9)
        for end, command in zip(ours, commands, strict=True):
            try:
                while end.recv_into(buffer):
                    pass
            except BlockingIOError:
                pass
            end.send(command)
        due += period
    cost = (time.process_time() - start_cpu) / cycles * 1e6
    peer.join(10)
    for pair in pairs:
        for end in pair:
            end.close()
    return cost


def measure() -> list[Figure]:
    with running("seven", lockstep=False) as (installation, loop, _):
        loop.enable("csp")
        loop.status()  # the CPU figure counts from one status to the next
        time.sleep(SECONDS)
        cost = loop.status().cpu_us
    return [Figure("cycle_cpu_7axis", cost, "µs", "bare socket loop, same bytes", bare_loop_us(installation))]
