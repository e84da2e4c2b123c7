"""CPU of one cycle for seven axes: the whole loop, beside a bare socket loop that passes the same bytes at the same
time and the same priority; and its exchange of values alone, beside `canopen` doing the same."""

from __future__ import annotations

import multiprocessing
import os
import socket
import struct
import time
from contextlib import suppress
from multiprocessing.connection import Connection

import can
import canopen

from benchmarks.figure import Figure
from benchmarks.standin import running
from config import Installation, load_installation
from driver.cia402.mapping import pdo_maps
from driver.cia402.pdo import PdoCodec

SECONDS = 10.0
FRAME = struct.Struct("<IB3x8s")
BATCHES, CYCLES_A_BATCH = 40, 100
"""The least of many short batches: what the neighbours on a shared machine add is left out."""


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


def bare_loop(told: Connection, counts: list[tuple[int, int]], period_ns: int, priority: int) -> None:
    """Tells the CPU µs a cycle of sleep, SYNC, sleep, drain, send: no decoding, no gate, no ring."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in counts]
    cycles = int(SECONDS * 1e9 / period_ns)
    peer = multiprocessing.get_context("fork").Process(
        target=answer, args=([b for _, b in pairs], [t for _, t in counts], cycles)
    )
    peer.start()
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    ours = [a for a, _ in pairs]
    commands = [b"".join(FRAME.pack(0x201 + k, 8, bytes(8)) for k in range(r)) for r, _ in counts]
    sync, buffer = FRAME.pack(0x80, 0, b""), bytearray(4096)
    for end in ours:
        end.setblocking(False)
    start_cpu, due = time.process_time(), time.monotonic_ns() + period_ns
    for _ in range(cycles):
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
        for end in ours:
            end.send(sync)
        time.sleep(period_ns / 2e9)
        for end, command in zip(ours, commands, strict=True):
            with suppress(BlockingIOError):
                while end.recv_into(buffer):
                    pass
            end.send(command)
        due += period_ns
    told.send((time.process_time() - start_cpu) / cycles * 1e6)
    peer.join(10)


def whole_loop() -> Figure:
    with running("seven", lockstep=False) as (installation, loop, _):
        loop.enable("csp")
        ours, theirs = multiprocessing.Pipe()
        cycle = installation.cycle
        bare = multiprocessing.get_context("fork").Process(
            target=bare_loop, args=(theirs, frames_a_cycle(installation), cycle.period_ns, cycle.priority)
        )
        loop.status()  # the CPU figure counts from one status to the next
        bare.start()
        reference = ours.recv()
        cost = loop.status().cpu_us
        bare.join()
    return Figure("cycle_cpu_7axis", cost, "µs", "bare socket loop, same bytes and time", reference)


def least_us(installation: Installation, codec: PdoCodec, tpdos: list[bytes]) -> float:
    """CPU µs to decode all TPDOs of a cycle and to encode all RPDOs, by our codec."""
    n = len(installation.joint)
    words, q, dq, tau = [0x0F] * n, [0.1] * n, [0.2] * n, [0.3] * n
    best = float("inf")
    for _ in range(BATCHES):
        start = time.process_time_ns()
        for k in range(CYCLES_A_BATCH):
            codec.begin_cycle(k + 1)
            for bus, packet in enumerate(tpdos):
                codec.receive(bus, packet, len(packet))
            codec.feedback()
            codec.encode(words, q, dq, tau)
        best = min(best, (time.process_time_ns() - start) / 1e3 / CYCLES_A_BATCH)
    return best


class Nowhere(can.BusABC):  # type: ignore[misc]
    """A bus that takes frames and gives none."""

    def __init__(self) -> None:
        super().__init__(channel="nowhere")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        pass

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return None, False


def canopen_us(installation: Installation) -> float:
    """CPU µs for the same PDOs by `canopen`: notified of each TPDO, values read and set by name, RPDOs sent."""
    network = canopen.Network(Nowhere())
    nodes = []
    for joint in installation.joint:
        drive = installation.drive_of(joint)
        node = network.add_node(canopen.RemoteNode(joint.node_id, str(drive.eds)))
        received: list[canopen.pdo.PdoMap] = []
        sent: list[canopen.pdo.PdoMap] = []
        for k, pdo in enumerate(pdo_maps(joint, drive, "csp")):
            pdo_map = (node.rpdo if pdo.receive else node.tpdo)[1 + k % 4]
            pdo_map.clear()
            for name in pdo.names:
                pdo_map.add_variable(drive.object(name).index)
            pdo_map.cob_id, pdo_map.enabled = pdo.cob_id, True
            (sent if pdo.receive else received).append(pdo_map)
            if not pdo.receive:
                network.subscribe(pdo.cob_id, pdo_map.on_message)
        nodes.append((received, sent))
    best = float("inf")
    for _ in range(BATCHES):
        start = time.process_time_ns()
        for _ in range(CYCLES_A_BATCH):
            for received, sent in nodes:
                for pdo_map in received:
                    network.notify(pdo_map.cob_id, bytearray(8), 0.0)
                    for variable in pdo_map:
                        _ = variable.raw
                for pdo_map in sent:
                    for variable in pdo_map:
                        variable.raw = 1
                    pdo_map.transmit()
        best = min(best, (time.process_time_ns() - start) / 1e3 / CYCLES_A_BATCH)
    network.bus.shutdown()
    return best


def values_alone() -> Figure:
    installation = load_installation("seven")
    codec = PdoCodec(installation, "csp")
    tpdos = []
    for bus in installation.bus:
        maps = [pdo for j, m in zip(installation.joint, codec.maps, strict=True) if j.bus == bus.name for pdo in m]
        sent = sorted((pdo for pdo in maps if not pdo.receive), key=lambda pdo: pdo.cob_id)
        tpdos.append(b"".join(FRAME.pack(pdo.cob_id, pdo.length, bytes(8)) for pdo in sent))
    cost = least_us(installation, codec, tpdos)
    return Figure("cycle_values_7axis", cost, "µs", "the same PDOs by canopen", canopen_us(installation))


def measure() -> list[Figure]:
    return [whole_loop(), values_alone()]
