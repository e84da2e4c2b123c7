"""SDO access against a drive that answers anything: every failure is one sentence, and no nonsense is a value."""

from __future__ import annotations

import struct
from collections.abc import Callable

import canopen
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from config import InputError, load_installation
from config.eds_check import read_eds
from driver.cia402.sdo import SdoObjects

JOINT = load_installation("dda").joint[0]
EDS = read_eds(load_installation("dda").drive_of(JOINT).eds)
Answers = Callable[[bytes], list[bytes]]
READ = struct.Struct("<BHB")


class Loopback(canopen.Network):
    """Answers each request in place, without a bus."""

    def __init__(self, answers: Answers) -> None:
        super().__init__()
        self.answers = answers
        self.requests: list[bytes] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert can_id == 0x601
        self.requests.append(bytes(data))
        if data[0] != 0x80:
            for answer in self.answers(bytes(data)):
                self.notify(0x581, bytearray(answer), 0.0)


def objects(answers: Answers) -> SdoObjects:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("driver.cia402.sdo.TIMEOUT_S", 0.005)
        return SdoObjects(Loopback(answers).add_node(1, EDS), JOINT)


def value_answer(request: bytes, value: bytes) -> bytes:
    return READ.pack(0x43 | (4 - len(value)) << 2, *READ.unpack_from(request)[1:]) + value.ljust(4, b"\0")


def refusal(answers: Answers, action: Callable[[SdoObjects], object]) -> str:
    with pytest.raises(InputError) as caught:
        action(objects(answers))
    sentence = str(caught.value)
    assert sentence.startswith("joint joint1 (node 1 on can0): ")
    return sentence


def test_a_value_by_the_type_of_the_eds() -> None:
    assert objects(lambda r: [value_answer(r, b"\x18\xfc")]).read(0x6077) == -1000
    assert objects(lambda r: [value_answer(r, b"\x18\xfc")]).read(0x6041) == 0xFC18
    assert objects(lambda r: [value_answer(r, b"\xff\xff\xff\xff")]).read(0x6064) == -1


def test_an_expedited_answer_without_size() -> None:
    assert objects(lambda r: [b"\x42" + r[1:4] + b"\x07\x00\x00\x00"]).read(0x6041) == 7


def test_a_value_in_a_segment() -> None:
    def answer(request: bytes) -> list[bytes]:
        if request[0] == 0x40:
            return [b"\x41" + request[1:4] + b"\x02\x00\x00\x00"]
        return [b"\x0b\x18\xfc" + bytes(5)]

    assert objects(answer).read(0x6077) == -1000


@example(b"\x53\0\0\0\0\0", 0x6041)  # Announces four bytes, brings two.
@given(st.binary(max_size=8), st.sampled_from((0x6041, 0x6077, 0x6064, 0x6502, 0x6061)))
def test_fuzzed_answers_never_pass_as_values(answer: bytes, index: int) -> None:
    def fuzzed(request: bytes) -> list[bytes]:
        # Now and then everything but the value is right, so that the interesting half is reached.
        return [answer] if len(answer) % 2 else [answer[:1] + request[1:4] + answer[4:]]

    drive = objects(fuzzed)
    size = {0x6041: 2, 0x6077: 2, 0x6064: 4, 0x6502: 4, 0x6061: 1}[index]
    try:
        value = drive.read(index)
    except InputError as error:
        assert f"{index:04X}:00" in str(error)
        return
    sent = fuzzed(b"\x40" + struct.pack("<HB", index, 0) + bytes(4))[0]
    assert sent[1:4] == struct.pack("<HB", index, 0)
    if sent[0] & 0x02:  # Expedited, and the announced size, where there is one, is the object's.
        assert not sent[0] & 0x01 or 4 - (sent[0] >> 2 & 3) == size
        assert value == int.from_bytes(sent[4 : 4 + size], "little", signed=index in (0x6077, 0x6064, 0x6061))


@given(st.binary(max_size=8))
def test_fuzzed_confirmations_never_pass_for_a_kept_value(answer: bytes) -> None:
    drive = objects(lambda r: [answer] if r[0] & 0xE0 == 0x20 else [value_answer(r, b"\x05\x00")])
    with pytest.raises(InputError, match="605A"):
        drive.write_verified(0x605A, 0, 6)


def test_silence() -> None:
    sentence = refusal(lambda _: [], lambda drive: drive.read(0x1000))
    assert "object 1000:00 (Device type) could not be read: the drive does not answer" in sentence
    assert "check supply, wiring, node id and bit rate" in sentence


def test_one_lost_answer_is_asked_for_again() -> None:
    asked: list[bytes] = []

    def answer(request: bytes) -> list[bytes]:
        asked.append(request)
        return [] if len(asked) == 1 else [value_answer(request, b"\x92\x01\x02\x00")]

    assert objects(answer).read(0x1000) == 0x20192


def test_an_abort_in_words() -> None:
    abort = struct.pack("<BHBI", 0x80, 0x6072, 0, 0x06090031)
    sentence = refusal(lambda _: [abort], lambda drive: drive.write(0x6072, 0, 1000))
    assert "6072:00 (Max torque) could not be written with 1000: the value is too high (abort 06090031)" in sentence


def test_the_answer_to_another_question() -> None:
    sentence = refusal(lambda r: [value_answer(b"\x40\x40\x60\x00", b"\x00\x00")], lambda drive: drive.read(0x6041))
    assert "bad answer" in sentence


def test_a_value_of_another_size() -> None:
    sentence = refusal(lambda r: [value_answer(r, b"\x01\x02\x03\x04")], lambda drive: drive.read(0x6041))
    assert "came with 4 bytes instead of 2" in sentence


def test_a_drive_that_keeps_another_value() -> None:
    def answer(request: bytes) -> list[bytes]:
        return [value_answer(request, b"\xe8\x03")] if request[0] == 0x40 else [b"\x60" + request[1:4] + bytes(4)]

    sentence = refusal(answer, lambda drive: drive.write_verified(0x6072, 0, 2000))
    assert "6072:00 (Max torque) is 1000 instead of 2000; the drive did not keep it" in sentence


def test_what_the_eds_forbids_is_not_even_sent() -> None:
    network = Loopback(lambda _: [])
    drive = SdoObjects(network.add_node(1, EDS), JOINT)
    with pytest.raises(InputError, match="takes 0 to 10000, not 10001"):
        drive.write(0x6072, 0, 10001)
    with pytest.raises(InputError, match="6099:00 is not in the drive's EDS"):
        drive.read(0x6099)
    with pytest.raises(InputError, match="is no integer"):
        drive.read(0x1008)
    assert network.requests == []
