"""What clients and the daemon say to each other: one JSON object a line, in both directions.

Request   {"id": 7, "command": "run", "arguments": {...}}
Progress  {"id": 7, "progress": {...}}          any number, before the answer
Answer    {"id": 7, "answer": {...}}  or  {"id": 7, "error": {"kind": ..., "message": ..., ...}}

An error's kind is "input" (with place, problem and remedy), "stopped" (the arm stopped; message is the cause),
"permission" (this socket may only look) or "defect" (an error of the daemon's own, in its log with a traceback).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from config import InputError
from service.outcomes import ArmStopped

LINE_LIMIT = 1 << 20
"""Bytes of the longest line either side accepts."""
ADDRESS_LIMIT = 107
"""Bytes of the longest AF_UNIX path Linux takes."""

ErrorKind = Literal["input", "stopped", "permission", "defect"]


class Request(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    id: int
    command: str = Field(max_length=64)
    arguments: dict[str, Any] = Field(default_factory=dict)


class MalformedRequest(Exception):
    """A line that is no request; ``request_id`` is the id when at least that could be read."""

    def __init__(self, message: str, request_id: int | None = None) -> None:
        self.request_id = request_id
        super().__init__(message)


def read_request(line: bytes) -> Request:
    """One line as a request. Raises MalformedRequest saying what is wrong with it."""
    try:
        data = json.loads(line)
    except (ValueError, RecursionError) as error:  # not JSON, not UTF-8, or an integer of thousands of digits
        raise MalformedRequest(f"the request is not JSON: {error}") from None
    given = data.get("id") if isinstance(data, dict) else None
    request_id = given if isinstance(given, int) and not isinstance(given, bool) else None
    try:
        return Request.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "request"
        raise MalformedRequest(f"the request is not as agreed: {where}: {first['msg']}", request_id) from None


def encode(message: dict[str, Any]) -> bytes:
    """One message as a line; NaN and infinity have no place in JSON and are refused by ValueError."""
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def error_of(error: BaseException) -> dict[str, Any]:
    """The ``error`` member that tells a client about an exception."""
    if isinstance(error, InputError):
        return {
            "kind": "input",
            "message": str(error),
            "place": error.place,
            "problem": error.problem,
            "remedy": error.remedy,
        }
    if isinstance(error, ArmStopped):
        return {"kind": "stopped", "message": str(error)}
    if isinstance(error, PermissionError):
        return {"kind": "permission", "message": str(error)}
    return {"kind": "defect", "message": f"{type(error).__name__}: {error}"}


def control_socket(run: Path, arm: str) -> Path:
    """The socket through which clients may move the arm."""
    return _addressable(run / f"{arm}.sock")


def look_socket(run: Path, arm: str) -> Path:
    """The socket through which clients may look, and nothing else."""
    return _addressable(run / f"{arm}-look.sock")


def _addressable(path: Path) -> Path:
    if len(str(path).encode()) > ADDRESS_LIMIT:
        raise InputError(
            str(path), f"a socket's path may have {ADDRESS_LIMIT} bytes", "set ETUDE_RUN to a shorter directory"
        )
    return path
