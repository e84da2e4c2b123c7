"""The daemon's sockets: who may connect, one task a request, and what happens when a client goes away.

Two sockets carry the permission, so that the kernel checks it: the control socket (mode 0660, group ``etude`` where
that group exists) takes every command; the look socket (mode 0666) takes those that only read.
"""

from __future__ import annotations

import asyncio
import contextlib
import grp
import logging
import os
import socket
import struct
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from config import InputError
from service.answers import finite
from service.daemon.protocol import LINE_LIMIT, MalformedRequest, Request, encode, error_of, read_request

log = logging.getLogger(__name__)
GROUP = "etude"
REQUESTS_AT_ONCE = 16
"""A client that has more requests open than this is read no further until some are answered."""
CONNECTIONS = 64
"""Conversations at once on each socket: whoever may only look must not use up what the daemon can have open."""
LAST_WORDS_S = 1.0
"""How long answers may take to go out once the server closes."""


@dataclass(frozen=True)
class Peer:
    """The process at the other end, as the kernel vouches for it."""

    pid: int
    uid: int


@dataclass(frozen=True)
class Call:
    """One request being served. ``progress`` sends a progress message to the client."""

    arguments: dict[str, Any]
    peer: Peer
    progress: Callable[[dict[str, Any]], Awaitable[None]]


@dataclass(frozen=True)
class Command:
    """A command of the protocol. The handler's task is cancelled when its client goes away."""

    handler: Callable[[Call], Awaitable[dict[str, Any]]]
    looks_only: bool = False


class Server:
    """Serves ``commands`` on both sockets from `start` to `close`."""

    def __init__(self, commands: Mapping[str, Command], control: Path, look: Path) -> None:
        self._commands = commands
        self._addresses = ((control, 0o660, False), (look, 0o666, True))
        self._servers: list[asyncio.Server] = []
        self._connections: set[asyncio.Task[None]] = set()
        self._conversations = {looks_only: 0 for _, _, looks_only in self._addresses}
        self._closing = False

    async def start(self) -> None:
        for path, mode, looks_only in self._addresses:
            line = _listen(path, mode)

            async def connected(
                reader: asyncio.StreamReader, writer: asyncio.StreamWriter, looks_only: bool = looks_only
            ) -> None:
                task = asyncio.current_task()
                assert task is not None
                self._connections.add(task)
                self._conversations[looks_only] += 1
                try:
                    if self._conversations[looks_only] > CONNECTIONS:
                        await _turn_away(writer)
                    else:
                        await self._converse(reader, writer, looks_only)
                except asyncio.CancelledError:
                    log.debug("the conversation ended with the server")
                finally:
                    self._conversations[looks_only] -= 1
                    self._connections.discard(task)

            self._servers.append(await asyncio.start_unix_server(connected, sock=line, limit=LINE_LIMIT))

    async def close(self) -> None:
        """Stop listening, let answers that are due go out, end all conversations and remove the sockets."""
        for server in self._servers:
            server.close()
        self._closing = True
        for task in list(self._connections):
            task.cancel()
        await asyncio.gather(*self._connections, return_exceptions=True)
        for path, _, _ in self._addresses:
            path.unlink(missing_ok=True)

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, looks_only: bool) -> None:
        peer = _peer(writer)
        sending = asyncio.Lock()
        free = asyncio.Semaphore(REQUESTS_AT_ONCE)
        open_calls: set[asyncio.Task[None]] = set()

        async def send(line: bytes) -> None:
            async with sending:
                writer.write(line)
                await writer.drain()

        async def answer(request: Request) -> None:
            try:
                await send(await self._serve(request, peer, looks_only, send))
            except ConnectionError:
                log.info("client %d left before its answer to %s", peer.pid, request.command)
            finally:
                free.release()

        try:
            while line := await reader.readline():
                try:
                    request = read_request(line)
                except MalformedRequest as error:
                    await send(encode({"id": error.request_id, "error": {"kind": "input", "message": str(error)}}))
                    continue
                await free.acquire()
                task = asyncio.create_task(answer(request))
                open_calls.add(task)
                task.add_done_callback(open_calls.discard)
        except ValueError:
            # The rest of an over-long line cannot be told from the next request, so the conversation ends here.
            with contextlib.suppress(ConnectionError):
                message = f"the request is longer than {LINE_LIMIT} bytes"
                await send(encode({"id": None, "error": {"kind": "input", "message": message}}))
        except ConnectionError:
            pass
        finally:
            if self._closing and open_calls:
                await asyncio.wait(open_calls, timeout=LAST_WORDS_S)
            for task in open_calls:
                task.cancel()
            await asyncio.gather(*open_calls, return_exceptions=True)
            writer.close()

    async def _serve(
        self, request: Request, peer: Peer, looks_only: bool, send: Callable[[bytes], Awaitable[None]]
    ) -> bytes:
        async def progress(news: dict[str, Any]) -> None:
            await send(encode({"id": request.id, "progress": news}))

        try:
            command = self._commands.get(request.command)
            if command is None:
                raise InputError(
                    "request", f"there is no command {request.command!r}", f"use one of {', '.join(self._commands)}"
                )
            if looks_only and not command.looks_only:
                raise PermissionError(f"user {peer.uid} may look but not {request.command}: join the group {GROUP}")
            answer = await command.handler(Call(request.arguments, peer, progress))
            # Encoded here, so that an answer that JSON cannot say is told to the client as the defect it is.
            return encode({"id": request.id, "answer": finite(answer)})
        except ConnectionError:
            raise
        except Exception as error:
            report = error_of(error)
            if report["kind"] == "defect":
                log.exception("serving %s failed", request.command)
            return encode({"id": request.id, "error": report})


async def _turn_away(writer: asyncio.StreamWriter) -> None:
    """One sentence, and the end."""
    message = f"the daemon already has {CONNECTIONS} conversations at this socket: end some, or wait"
    with contextlib.suppress(ConnectionError):
        writer.write(encode({"id": None, "error": {"kind": "input", "message": message}}))
        await writer.drain()
    writer.close()


def _listen(path: Path, mode: int) -> socket.socket:
    path.unlink(missing_ok=True)  # the arm's lock is held, so a socket found here belongs to nobody
    line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        # Nobody may connect between bind and the final mode.
        previous = os.umask(0o777)
        try:
            line.bind(str(path))
        finally:
            os.umask(previous)
        if mode == 0o660:
            with contextlib.suppress(KeyError, PermissionError):
                os.chown(path, -1, grp.getgrnam(GROUP).gr_gid)
        path.chmod(mode)
    except OSError as error:
        line.close()
        raise InputError(
            str(path), f"the daemon's socket cannot be made ({error.strerror})", "check the run directory's permissions"
        ) from None
    return line


def _peer(writer: asyncio.StreamWriter) -> Peer:
    line: socket.socket = writer.get_extra_info("socket")
    pid, uid, _ = struct.unpack("3i", line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))
    return Peer(pid, uid)
