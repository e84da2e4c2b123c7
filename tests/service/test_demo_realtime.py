"""What the demo says when wall-clock time was too fast for the machine."""

from __future__ import annotations

from service.demo.story import too_slow

STOP = "joint1: no feedback for 5 cycles"


def test_missed_cycles_are_told_as_a_slow_machine_with_their_count_and_a_remedy() -> None:
    sentence = too_slow({"missed": 57, "cycles": 2042}, STOP)
    assert sentence is not None
    assert "too slow to keep 1000 Hz" in sentence
    assert "57 of 2042 cycles" in sentence
    assert STOP in sentence
    assert "leave out --realtime" in sentence


def test_a_stop_without_missed_cycles_keeps_its_own_cause() -> None:
    assert too_slow({"missed": 0, "cycles": 2042}, STOP) is None
