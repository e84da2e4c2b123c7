"""Lines between client and daemon: whatever comes in, a request or a sentence comes out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config import InputError
from service.daemon.client import _raised
from service.daemon.protocol import MalformedRequest, control_socket, encode, error_of, read_request
from service.outcomes import ArmStopped


def test_a_request_is_read() -> None:
    request = read_request(b'{"id": 3, "command": "run", "arguments": {"motion": "a"}}\n')
    assert (request.id, request.command, request.arguments) == (3, "run", {"motion": "a"})


@pytest.mark.parametrize(
    ("line", "said", "number"),
    [
        (b"nonsense\n", "not JSON", None),
        (b"\xff\xfe\n", "not JSON", None),
        (b"[" * 100_000, "not JSON", None),
        (b"[1, 2]\n", "not as agreed", None),
        (b'{"id": 4}\n', "command", 4),
        (b'{"id": "4", "command": "run"}\n', "id", None),
        (b'{"id": 4, "command": "run", "arguments": []}\n', "arguments", 4),
        (b'{"id": 4, "command": "run", "extra": 1}\n', "extra", 4),
    ],
)
def test_what_is_wrong_with_a_line_is_said(line: bytes, said: str, number: int | None) -> None:
    with pytest.raises(MalformedRequest, match=said) as caught:
        read_request(line)
    assert caught.value.request_id == number


@given(st.binary(max_size=200))
def test_no_bytes_do_harm(line: bytes) -> None:
    try:
        request = read_request(line)
    except MalformedRequest:
        return
    assert isinstance(request.command, str)


def test_a_message_is_one_line_and_never_nan() -> None:
    assert encode({"id": 1, "answer": {"text": "a\nb"}}).count(b"\n") == 1
    with pytest.raises(ValueError, match="JSON"):
        encode({"id": 1, "answer": {"x": float("nan")}})


@pytest.mark.parametrize(
    "error", [InputError("file.toml", "has no key", "add it"), ArmStopped("joint2: following error")]
)
def test_errors_arrive_as_they_were_raised(error: Exception) -> None:
    arrived = _raised(json.loads(json.dumps(error_of(error))))
    assert type(arrived) is type(error)
    assert str(arrived) == str(error)


def test_a_run_directory_too_long_for_a_socket_is_refused() -> None:
    with pytest.raises(InputError, match="ETUDE_RUN"):
        control_socket(Path("/" + "x" * 120), "dda")
