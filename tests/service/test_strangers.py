"""Whatever is said at the daemon's sockets, the daemon goes on, says what is wrong, and the arm does not move."""

from __future__ import annotations

import asyncio
import json
import os
import random
import stat
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from config import load_installation
from driver.cyclic.cycle import LoopState
from driver.cyclic.status import LoopStatus, RealtimeReport
from service.daemon.commands import commands_of
from service.daemon.protocol import LINE_LIMIT
from service.daemon.server import CONNECTIONS, Server
from service.sessions.conductor import Conductor
from service.sessions.standing_recorder import RecorderReport
from service.sessions.store import SessionStore

pytestmark = pytest.mark.timeout(600)
DDA = load_installation("dda")
MUTATIONS = 20_000 if os.environ.get("ETUDE_FAULTS") == "full" else 800
COMMANDS = ("run", "identify_links", "identify_load", "practise", "compare_controllers", "status", "follow")
"""All but those that act without arguments: stop and reset."""
KEYS = ("motion", "mode", "controller", "feedforward", "attached", "motions", "trials", "load", "without", "hold_out",
        "model", "arguments", "id", "\x00", "")  # fmt: skip
STRANGE = (
    "null", "true", "-1", "0", "1e999", "-1e999", "NaN", "Infinity", "1" * 400, "1" * 5000, "0.1e-400",
    '""', '"\\u0000"', '"/\\u0000"', '"\\ud800"', '"/\\ud800"', '"/dev"', '"/dev/zero"', '"/dev/stdin.toml"',
    '"/proc/self/mem"', '"~nobody-here/x"', '"../../../etc/passwd"', '"nobody@1"', '"' + "x" * 5000 + '"',
    '"' + "/x" * 4000 + '.toml"', "[]", "{}", "[[[[]]]]", "[" * 500 + "]" * 500, '{"a":' * 300 + "1" + "}" * 300,
    "[1e308,1e308,-1e308]", '{"__class__":"x"}', '"!!python/object/apply:os.system"',
)  # fmt: skip


class StillArm:
    """An arm that notes whatever would move it."""

    def __init__(self) -> None:
        self.installation = DDA
        self.asked: list[str] = []
        joints = len(DDA.joint)
        zeros = (0.0,) * joints
        status = LoopStatus(
            state=LoopState.IDLE, mode="csp", cause=None, time_ns=0, q_d=zeros, q=zeros, dq=zeros, tau=zeros,
            valid=(True,) * joints, drive_states=("off",) * joints, run=0, last_run=0, progress=0.0, run_outcome=None,
            cycles=1, good_cycles=1, missed=0, lateness_us=(), lateness_max_us=0.0, cpu_us=1.0, lockstep=True,
            realtime=RealtimeReport("normal", False, 0, ()), buses=(), sensors=(), last_frames=(),
        )  # fmt: skip
        self.loop = SimpleNamespace(alive=True, status=lambda: status, reset=lambda: self.asked.append("reset"))
        self.recorder = SimpleNamespace(report=lambda: RecorderReport("ready", 1, None, 0, None))
        self.load_now: dict[str, Any] | None = None

    def __getattr__(self, name: str) -> Any:
        async def moved(*_: Any) -> None:
            self.asked.append(name)

        return moved


class Stranger:
    """A connection at which anything is said; it is made again where the daemon has hung up."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._ends: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._number = 1_000_000
        self.hung_up = 0

    async def say(self, line: bytes) -> list[dict[str, Any]]:
        """What is answered to the line, before a status that is asked next is answered; [] after a hanging up."""
        if self._ends is None:
            self._ends = await asyncio.open_unix_connection(str(self._path), limit=16 * LINE_LIMIT)
        reader, writer = self._ends
        self._number += 1
        ask = json.dumps({"id": self._number, "command": "status"}).encode()
        answers = list[dict[str, Any]]()
        try:
            writer.write(line + b"\n" + ask + b"\n")
            await writer.drain()
            status_seen = False
            # A request is served while the next is read, so the answers come in any order.
            while not status_seen or not answers:
                heard = await asyncio.wait_for(reader.readline(), 30)
                if not heard:
                    raise ConnectionResetError
                message = json.loads(heard)
                if message["id"] == self._number:
                    assert message["answer"]["arm"] == "dda"
                    status_seen = True
                else:
                    answers.append(message)
        except ConnectionError:
            self.hung_up += 1
            await self.leave()
        return answers

    async def leave(self) -> None:
        if self._ends is not None:
            self._ends[1].close()
            self._ends = None


@asynccontextmanager
async def served(folder: Path) -> AsyncIterator[tuple[StillArm, Path, Path]]:
    arm = StillArm()
    control, look = folder / "a.sock", folder / "a-look.sock"
    conductor = Conductor(arm, SessionStore(folder / "state", "dda"))  # type: ignore[arg-type]
    server = Server(commands_of(conductor), control, look)
    await server.start()
    try:
        yield arm, control, look
    finally:
        await server.close()


def on_daemon(folder: Path, story: Callable[[StillArm, Path, Path], Awaitable[None]]) -> None:
    async def told() -> None:
        async with served(folder) as (arm, control, look):
            await story(arm, control, look)
            assert arm.asked == []
        assert not (folder / "state" / "dda" / "sessions").exists(), "no session was begun"

    asyncio.run(told())


def strange_requests() -> Iterator[bytes]:
    """JSON of wrong shapes: in place of the request, of each member, of each argument of each command."""
    for value in STRANGE:
        yield value.encode()
        yield f'{{"id":{value},"command":"run","arguments":{{}}}}'.encode()
        yield f'{{"id":1,"command":{value},"arguments":{{}}}}'.encode()
        yield f'{{"id":1,"command":"run","arguments":{value}}}'.encode()
        yield f'{{"id":1,"command":"run","arguments":{{}},"more":{value}}}'.encode()
        for command in ("run", "practise"):
            for key in ("motion", "mode", "trials", "feedforward"):
                motion = "" if key == "motion" else '"motion":"none",'
                yield f'{{"id":1,"command":"{command}","arguments":{{{motion}"{key}":{value}}}}}'.encode()


def mutated_requests(number: int, seed: int) -> Iterator[bytes]:
    """Requests as they should be of a motion that does not exist, with bytes flipped, lost, doubled, and noise."""
    rng = random.Random(seed)
    for k in range(number):
        command, key = rng.choice(COMMANDS), rng.choice(KEYS)
        value = rng.choice((rng.random(), None, "none", [1], {"a": {}}, True, 10**30))
        data = bytearray(
            json.dumps({"id": k, "command": command, "arguments": {key: value, "motion": "none"}}).encode()
        )
        for _ in range(rng.choice((0, 1, 1, 2, 5))):
            at, what = rng.randrange(len(data) + 1), rng.randrange(4)
            if what == 0 and at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            elif what == 1:
                del data[at : at + rng.randrange(1, 9)]
            elif what == 2:
                data[at:at] = data[: rng.randrange(1, 30)]
            else:
                data[at:at] = rng.randbytes(rng.randrange(1, 20))
        yield bytes(data).replace(b"\n", b" ")


@pytest.mark.parametrize("socket", ["control", "look"])
def test_no_request_takes_the_daemon_down_or_moves_the_arm(socket: str, tmp_path: Path) -> None:
    async def story(arm: StillArm, control: Path, look: Path) -> None:
        stranger = Stranger(control if socket == "control" else look)
        for line in (*strange_requests(), *mutated_requests(MUTATIONS, seed=5)):
            for answer in await stranger.say(line):
                if "error" in answer:
                    assert answer["error"]["kind"] in ("input", "permission"), (line[:300], answer)
                    if socket == "look" and answer["error"]["kind"] == "permission":
                        assert "look" in answer["error"]["message"]
        assert stranger.hung_up == 0, "only a line beyond the limit ends a conversation"
        await stranger.leave()

    on_daemon(tmp_path, story)


@pytest.mark.parametrize("size", [LINE_LIMIT - 100, LINE_LIMIT, LINE_LIMIT + 1, 3 * LINE_LIMIT])
@pytest.mark.parametrize("fill", [b"[", b"1", b'"', b"\\", b" ", b"\xff", b'{"a":'])
def test_long_lines(size: int, fill: bytes, tmp_path: Path) -> None:
    async def story(arm: StillArm, control: Path, look: Path) -> None:
        stranger = Stranger(look)
        await stranger.say((fill * (size // len(fill) + 1))[:size])
        assert stranger.hung_up == (size > LINE_LIMIT)
        await stranger.say(b"1")
        await stranger.leave()

    on_daemon(tmp_path, story)


def test_the_look_socket_refuses_every_command_that_does_more(tmp_path: Path) -> None:
    async def story(arm: StillArm, control: Path, look: Path) -> None:
        stranger = Stranger(look)
        for command in ("run", "identify_links", "identify_load", "practise", "compare_controllers", "stop", "reset"):
            line = json.dumps({"id": 1, "command": command, "arguments": {"motion": "dda-identify-1"}}).encode()
            (answer,) = await stranger.say(line)
            assert answer["error"]["kind"] == "permission"
        await stranger.leave()

    on_daemon(tmp_path, story)


def test_who_only_looks_cannot_use_up_the_daemons_files(tmp_path: Path) -> None:
    """Beyond so many conversations at one socket the next ends at once; those who may move the arm still get in."""

    async def story(arm: StillArm, control: Path, look: Path) -> None:
        crowd = [await asyncio.open_unix_connection(str(look)) for _ in range(CONNECTIONS)]
        for _, writer in crowd:
            writer.write(b'{"id":1,"command":"status"}\n')
        for reader, _ in crowd:
            assert b"answer" in await asyncio.wait_for(reader.readline(), 30)
        reader, writer = await asyncio.open_unix_connection(str(look))
        refusal = json.loads(await asyncio.wait_for(reader.readline(), 30))
        assert "conversations" in refusal["error"]["message"]
        assert await reader.read() == b""
        writer.close()
        owner = Stranger(control)
        assert len(await owner.say(b"{}")) == 1
        await owner.leave()
        for _, writer in crowd:
            writer.close()
        for _ in range(100):
            await asyncio.sleep(0.02)
            again = Stranger(look)
            await again.say(b"{}")
            await again.leave()
            if not again.hung_up:
                break
        else:
            pytest.fail("nobody gets in after the crowd has left")

    on_daemon(tmp_path, story)


def test_permissions_of_the_sockets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """0660 and the group etude for those who may move the arm, 0666 for those who look."""
    owners = list[tuple[str, int, int]]()
    monkeypatch.setattr("service.daemon.server.grp.getgrnam", lambda name: SimpleNamespace(gr_gid=4711, name=name))
    monkeypatch.setattr(
        "service.daemon.server.os.chown", lambda path, uid, gid: owners.append((Path(path).name, uid, gid))
    )

    async def story(arm: StillArm, control: Path, look: Path) -> None:
        assert stat.S_IMODE(control.stat().st_mode) == 0o660
        assert stat.S_IMODE(look.stat().st_mode) == 0o666
        assert owners == [("a.sock", -1, 4711)]

    on_daemon(tmp_path, story)


def test_an_answer_that_json_cannot_say_is_told_as_a_defect_and_the_conversation_goes_on(tmp_path: Path) -> None:
    async def story(arm: StillArm, control: Path, look: Path) -> None:
        arm.load_now = {"mass": object()}
        reader, writer = await asyncio.open_unix_connection(str(look))
        for number in (1, 2):
            writer.write(b'{"id": %d, "command": "status"}\n' % number)
            answer = json.loads(await asyncio.wait_for(reader.readline(), 30))
            assert answer["id"] == number
            assert answer["error"]["kind"] == "defect"
            assert "JSON" in answer["error"]["message"]
        writer.close()

    on_daemon(tmp_path, story)
