"""No wrench that was not sent is taken for one, and the stream is found again within two frames."""

from __future__ import annotations

import os

import numpy as np
import pytest

from tests.faults.spoilt_streams import Kind, checksums, frames_of, judge

pytestmark = pytest.mark.timeout(900)
BYTES = 10_000_000 if os.environ.get("ETUDE_FAULTS") == "full" else 1_000_000
"""Of both protocols together."""


def test_the_checksums_of_the_streams_have_the_catalogued_values() -> None:
    row = np.frombuffer(b"123456789", np.uint8)[None]
    assert checksums(row, 0x8408, True)[0] == 0x906E
    assert checksums(row, 0xA001, False)[0] == 0x4B37
    assert frames_of("bota", 3, np.random.default_rng(0)).shape == (3, 37)


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
def test_spoilt_streams(kind: Kind) -> None:
    judged = judge(kind, BYTES // 2, seed=1)
    assert judged.fed >= 0.9 * BYTES / 2
    assert judged.spoilt > judged.fed / 37 / 20
    assert judged.wrong == 0
    assert judged.slow == []
    if kind == "bota":
        # Its frames carry time: one that comes again is known. Those of an FT 300 do not.
        assert judged.again == 0
    assert judged.good > 0.8 * judged.fed / (37 if kind == "bota" else 16)
