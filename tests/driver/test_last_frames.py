"""What is kept of every bus and serial line when the arm stops."""

from __future__ import annotations

import struct

from driver.cyclic.last_frames import CYCLES, DELIVERIES, LINES, LastFrames

FRAME = struct.Struct("<IB3x8s")


def frame(can_id: int, data: bytes) -> bytes:
    return FRAME.pack(can_id, len(data), data)


def test_every_bus_and_line_has_its_last() -> None:
    """A bus that babbles, and a sensor that speaks every tenth cycle, beside a quiet bus."""
    kept = LastFrames(["can0", "can1"], ["wrist", "ankle"])
    for cycle in range(400):
        now = 1_000_000_000 + cycle * 1_000_000
        batches = [
            (0, True, now, frame(0x080, b"")),
            (1, True, now, frame(0x080, b"")),
            (1, False, now + 300_000, frame(0x001, bytes(8)) * 60),
        ]
        serial = [(0, bytes([cycle % 256]) * 40)] + ([(1, b"\x20\x4e")] if cycle % 10 == 0 else [])
        kept.add(batches, serial, now + 500_000)
    assert kept.frozen == ()
    kept.freeze()
    lines = kept.frozen
    by_channel = {name: [x for x in lines if x.split()[1] == name] for name in ("can0", "can1", "wrist", "ankle")}
    assert by_channel["can0"] == [f"{1.392 + k / 1000:.6f} can0 sent 080" for k in range(CYCLES)]
    assert len(by_channel["can1"]) == LINES
    assert by_channel["can1"][-1] == "1.399300 can1 received 001 00 00 00 00 00 00 00 00"
    # 40 bytes are a line and a bit.
    assert len(by_channel["wrist"]) == 2 * DELIVERIES
    assert by_channel["wrist"][-2:] == [
        "1.399500 wrist received " + "8f " * 36 + "8f",
        "1.399500 wrist received 8f 8f 8f",
    ]
    assert by_channel["ankle"][0] == "1.240500 ankle received 20 4e"
    assert [float(x.split()[0]) for x in lines] == sorted(float(x.split()[0]) for x in lines)


def test_what_is_kept_stays_until_the_next_stop() -> None:
    kept = LastFrames(["can0"])
    kept.add([(0, False, 1_000_000_000, frame(0x181, b"\x27\x02"))])
    kept.freeze()
    before = kept.frozen
    kept.add([(0, False, 2_000_000_000, frame(0x182, b""))])
    assert kept.frozen == before == ("1.000000 can0 received 181 27 02",)
