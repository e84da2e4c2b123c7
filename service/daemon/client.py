"""The client's end of the daemon's socket: blocking, for the command line."""

from __future__ import annotations

import itertools
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from config import InputError
from service.daemon.protocol import control_socket, encode, look_socket
from service.outcomes import ArmStopped, NoDaemon


class DaemonDefect(Exception):
    """The daemon failed by an error of its own; its log has the traceback."""


class DaemonClient:
    """A connection to the daemon of ``arm``; a context manager.

    ``looks_only``: fall back to the socket that only reads when this user may not move the arm.
    Raises NoDaemon when none answers, InputError when this user may not connect.
    """

    def __init__(self, run: Path, arm: str, *, looks_only: bool = False) -> None:
        self._arm = arm
        self._numbers = itertools.count(1)
        paths = [control_socket(run, arm), *([look_socket(run, arm)] if looks_only else [])]
        self._line = _connect(paths, arm)
        self._received = self._line.makefile("rb")

    def __enter__(self) -> DaemonClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._received.close()
        self._line.close()

    def call(
        self,
        command: str,
        arguments: dict[str, Any] | None = None,
        progress: Callable[[dict[str, Any]], None] = lambda news: None,
    ) -> dict[str, Any]:
        """Ask, pass every progress message on, and return the answer.

        Raises InputError and ArmStopped as the daemon raised them, NoDaemon when it goes away meanwhile,
        DaemonDefect on an error of its own.
        """
        number = next(self._numbers)
        try:
            self._line.sendall(encode({"id": number, "command": command, "arguments": arguments or {}}))
            for line in self._received:
                message = json.loads(line)
                if message["id"] not in (number, None):
                    continue
                if "progress" in message:
                    progress(message["progress"])
                elif "error" in message:
                    raise _raised(message["error"])
                else:
                    answer: dict[str, Any] = message["answer"]
                    return answer
        except ConnectionError:
            pass
        raise NoDaemon(f"the daemon of arm {self._arm} went away while it worked on {command}; see its log")


def _connect(paths: list[Path], arm: str) -> socket.socket:
    refused: Path | None = None
    for path in paths:
        line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        try:
            line.connect(str(path))
            return line
        except (FileNotFoundError, ConnectionRefusedError):
            line.close()
        except PermissionError:
            line.close()
            refused = path
    if refused is not None:
        raise InputError(
            str(refused), f"user {os.getuid()} may not use this socket", "join the group etude (and log in again)"
        )
    raise NoDaemon(f"no daemon serves arm {arm} at {paths[0]}; start one with: etude up --arm {arm}")


def _raised(error: dict[str, Any]) -> Exception:
    if error["kind"] == "input":
        return (
            InputError(error["place"], error["problem"], error["remedy"])
            if "place" in error
            else InputError("request", error["message"])
        )
    if error["kind"] == "stopped":
        return ArmStopped(error["message"])
    if error["kind"] == "permission":
        return InputError("daemon", error["message"])
    return DaemonDefect(error["message"])
