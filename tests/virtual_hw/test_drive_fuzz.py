"""Any frame of any length on any identifier: the drive answers or ignores, and goes on working."""

from __future__ import annotations

import random
from typing import Any

import pytest

from virtual_hw.bus.frames import CAN_FRAME, EXTENDED, REMOTE

IDS = (0x000, 0x080, 0x081, 0x201, 0x301, 0x401, 0x501, 0x601, 0x701, 0x77E)


@pytest.mark.parametrize("seed", range(4))
def test_any_frame(bench: Any, seed: int) -> None:
    draw = random.Random(seed)
    bench.nmt(0x01)
    for k in range(1500):
        can_id = draw.choice(IDS) if draw.random() < 0.9 else draw.randrange(1 << 29) | draw.choice((EXTENDED, REMOTE))
        raw = CAN_FRAME.pack(can_id & 0xDFFF_FFFF, draw.randrange(9), draw.randbytes(8))
        bench.bus.send(bench.host, raw)
        if k % 20 == 0:
            bench.run(3)
    bench.nmt(0x81)
    bench.heard.clear()
    assert bench.read(0x1000) == 0x00020192
    bench.enable()


@pytest.mark.parametrize("seed", range(4))
def test_any_sdo_request(bench: Any, seed: int) -> None:
    draw = random.Random(100 + seed)
    indices = sorted({index for index, _ in bench.node.store._entries})
    for _ in range(3000):
        head = bytes((draw.randrange(256),)) + draw.choice(indices).to_bytes(2, "little") + bytes((draw.randrange(10),))
        bench.heard.clear()
        bench.bus.exchange_at_once(bench.host, CAN_FRAME.pack(0x601, 8, head + draw.randbytes(4)))
        answers = bench.frames(0x581)
        assert all(len(answer) == 8 for answer in answers)
        assert len(answers) <= 1
        bench.run(0.5)
    bench.nmt(0x81)
    assert bench.read(0x1000) == 0x00020192
