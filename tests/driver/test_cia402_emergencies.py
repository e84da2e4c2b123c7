"""Emergencies, error registers and aborts in words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from driver.cia402.emergencies import abort_words, decode_emergency, error_code_words, register_words


def test_an_emergency_names_what_and_what_to_do() -> None:
    emergency = decode_emergency(0x083, bytes.fromhex("30 81 11 00 00 00 00 2a"))
    assert (emergency.node_id, emergency.code, emergency.register) == (3, 0x8130, 0x11)
    assert str(emergency) == (
        "the host's heartbeat was lost (EMCY 8130, error register generic error, communication, "
        "vendor 00 00 00 00 2a); reset the communication (a fault reset alone is not enough)"
    )
    assert not emergency.reset


def test_the_end_of_all_errors() -> None:
    emergency = decode_emergency(0x081, bytes(8))
    assert emergency.reset
    assert str(emergency) == "error reset, no error left (EMCY 0000, error register clear)"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x8611, "following error"),
        (0x8619, "positioning error"),
        (0x2311, "continuous over-current"),
        (0x23FF, "current error"),
        (0x7306, "sensor fault"),
        (0xFF42, "manufacturer's error"),
        (0xB123, "unknown error"),
        (0x0010, "error reset, no error left"),
    ],
)
def test_the_code_or_its_narrowest_known_class(code: int, words: str) -> None:
    assert error_code_words(code)[0] == words


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_any_bytes_are_an_emergency_or_refused(can_id: int, data: bytes) -> None:
    whole = len(data) == 8 and 0x81 <= can_id <= 0xFF
    try:
        emergency = decode_emergency(can_id, data)
    except ValueError:
        assert not whole
    else:
        assert whole
        assert emergency.words
        assert f"EMCY {int.from_bytes(data[:2], 'little'):04X}" in str(emergency)


def test_error_register() -> None:
    assert register_words(0) == "clear"
    assert register_words(0x83) == "generic error, current, manufacturer"
    assert register_words(0x40) == "0x40"


@given(st.integers(0, 0xFFFF_FFFF))
def test_every_abort_code_has_words(code: int) -> None:
    assert abort_words(code).endswith(f"(abort {code:08X})")


def test_aborts_worth_naming() -> None:
    assert abort_words(0x06020000) == "the drive has no such object (abort 06020000)"
    assert abort_words(0x08000022) == "the drive's present state forbids it (abort 08000022)"
