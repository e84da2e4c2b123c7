"""The sockets: permissions, malformed and hostile clients, clients that go away."""

from __future__ import annotations

import asyncio
import json
import stat
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from config import InputError
from service.daemon.protocol import LINE_LIMIT
from service.daemon.server import Call, Command, Server
from service.outcomes import ArmStopped


class Commands:
    """Handlers that remember what became of them."""

    def __init__(self) -> None:
        self.started = asyncio.Event()
        self.cancelled = asyncio.Event()

    async def echo(self, call: Call) -> dict[str, Any]:
        return {"heard": call.arguments, "uid": call.peer.uid}

    async def steps(self, call: Call) -> dict[str, Any]:
        for k in range(3):
            await call.progress({"step": k})
        return {"steps": 3}

    async def endless(self, call: Call) -> dict[str, Any]:
        self.started.set()
        try:
            await asyncio.Event().wait()
        finally:
            self.cancelled.set()
        return {}

    async def refuse(self, call: Call) -> dict[str, Any]:
        raise InputError("motion", "is too fast", "slow it down")

    async def stopped(self, call: Call) -> dict[str, Any]:
        raise ArmStopped("joint1 left its limits")

    async def broken(self, call: Call) -> dict[str, Any]:
        raise ZeroDivisionError("division by zero")

    async def not_a_number(self, call: Call) -> dict[str, Any]:
        return {"x": float("nan"), "y": (1.0, float("inf"))}

    def table(self) -> dict[str, Command]:
        names = ("echo", "steps", "endless", "refuse", "stopped", "broken", "not_a_number")
        return {name: Command(getattr(self, name), looks_only=name == "echo") for name in names}


class Line:
    """A raw connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def say(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def hear(self) -> dict[str, Any]:
        heard: dict[str, Any] = json.loads(await asyncio.wait_for(self.reader.readline(), 10))
        return heard

    async def ask(self, command: str, number: int = 1, **arguments: Any) -> dict[str, Any]:
        await self.say(json.dumps({"id": number, "command": command, "arguments": arguments}).encode() + b"\n")
        return await self.hear()


@asynccontextmanager
async def served(folder: Path) -> AsyncIterator[tuple[Commands, Path, Path]]:
    commands = Commands()
    control, look = folder / "a.sock", folder / "a-look.sock"
    server = Server(commands.table(), control, look)
    await server.start()
    try:
        yield commands, control, look
    finally:
        await server.close()
    assert not control.exists()
    assert not look.exists()


@asynccontextmanager
async def connected(path: Path) -> AsyncIterator[Line]:
    reader, writer = await asyncio.open_unix_connection(str(path), limit=4 * LINE_LIMIT)
    try:
        yield Line(reader, writer)
    finally:
        writer.close()


def on_server(folder: Path, story: Callable[[Commands, Path, Path], Awaitable[None]]) -> None:
    async def told() -> None:
        async with served(folder) as (commands, control, look):
            await story(commands, control, look)

    asyncio.run(told())


def test_answers_progress_and_errors(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        async with connected(control) as line:
            assert (await line.ask("echo", 5, x=1))["answer"]["heard"] == {"x": 1}
            assert await line.ask("steps", 6) == {"id": 6, "progress": {"step": 0}}
            assert [await line.hear() for _ in range(3)][-1] == {"id": 6, "answer": {"steps": 3}}
            refused = (await line.ask("refuse"))["error"]
            assert (refused["kind"], refused["message"]) == ("input", "motion: is too fast; slow it down")
            assert (await line.ask("stopped"))["error"] == {"kind": "stopped", "message": "joint1 left its limits"}
            assert (await line.ask("broken"))["error"]["kind"] == "defect"
            assert (await line.ask("not_a_number"))["answer"] == {"x": None, "y": [1.0, None]}
            assert "echo" in (await line.ask("nothing"))["error"]["remedy"]

    on_server(tmp_path, story)


def test_the_look_socket_moves_nothing(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        assert stat.S_IMODE(control.stat().st_mode) == 0o660
        assert stat.S_IMODE(look.stat().st_mode) == 0o666
        async with connected(look) as line:
            assert "answer" in await line.ask("echo")
            refused = (await line.ask("endless"))["error"]
            assert refused["kind"] == "permission"
            assert not commands.started.is_set()

    on_server(tmp_path, story)


def test_malformed_lines_are_answered_and_the_conversation_goes_on(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        async with connected(control) as line:
            for bad in (b"nonsense\n", b"{}\n", b"\x00\xff\n", b'{"id": 1, "command": 7}\n', b"\n"):
                await line.say(bad)
                assert (await line.hear())["error"]["kind"] == "input"
            assert "answer" in await line.ask("echo")

    on_server(tmp_path, story)


def test_a_line_without_end_ends_the_conversation_only(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        async with connected(control) as line:
            line.writer.write(b"x" * (2 * LINE_LIMIT))
            try:
                assert "longer" in (await line.hear())["error"]["message"]
                assert await line.reader.read() == b""
            except ConnectionResetError:
                pass  # what was not read yet when the daemon hung up takes its last words with it
        async with connected(control) as line:
            assert "answer" in await line.ask("echo")

    on_server(tmp_path, story)


def test_a_client_that_goes_away_cancels_what_it_asked(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        async with connected(control) as line:
            await line.say(b'{"id": 1, "command": "endless"}\n')
            await asyncio.wait_for(commands.started.wait(), 10)
        await asyncio.wait_for(commands.cancelled.wait(), 10)
        async with connected(control) as line:
            assert "answer" in await line.ask("echo")

    on_server(tmp_path, story)


def test_a_slow_request_does_not_hold_up_another(tmp_path: Path) -> None:
    async def story(commands: Commands, control: Path, look: Path) -> None:
        async with connected(control) as line:
            await line.say(b'{"id": 1, "command": "endless"}\n')
            assert (await line.ask("echo", 2))["id"] == 2

    on_server(tmp_path, story)
