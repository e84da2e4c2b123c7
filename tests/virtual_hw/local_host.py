"""A host at the stand-in's socket of one bus: frames, ticks and marks by hand."""

from __future__ import annotations

import socket
import struct
from pathlib import Path

from virtual_hw.bus.frames import CAN_FRAME, MARK, MARK_ID, frame

TICK, MARK_KIND, SERIAL, HELLO = 1, 2, 3, 4


class Host:
    """One connection, frames and marks by hand."""

    def __init__(self, path: Path) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.settimeout(10)
        self.socket.connect(str(path))
        (self.hello,) = self.receive()

    def __enter__(self) -> Host:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, *raw: bytes) -> None:
        self.socket.send(b"".join(raw))

    def receive(self) -> list[bytes]:
        packet = self.socket.recv(1 << 16)
        return [packet[k : k + 16] for k in range(0, len(packet), 16)]

    def until_mark(self, t_ns: int) -> list[bytes]:
        heard: list[bytes] = []
        while not heard or heard[-1] != mark(t_ns):
            heard += self.receive()
        return heard

    def sdo_read(self, node: int, index: int) -> int:
        self.send(frame(0x600 + node, struct.pack("<BHB4x", 0x40, index, 0)))
        while True:
            for raw in self.receive():
                can_id, _, data = CAN_FRAME.unpack(raw)
                if can_id == 0x580 + node:
                    return int.from_bytes(data[4:], "little")


def mark(t_ns: int) -> bytes:
    return MARK.pack(MARK_ID, MARK_KIND, t_ns)


def tick(t_ns: int) -> bytes:
    return MARK.pack(MARK_ID, TICK, t_ns)
