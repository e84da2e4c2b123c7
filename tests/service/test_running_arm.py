"""Where no arm is named, the running one is meant, also by commands that read its files without the daemon."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from config import load_installation
from config.paths import run_directory
from service.cli.options import installation_of
from service.daemon.protocol import control_socket, look_socket
from service.daemon.server import Call, Command, Server


def _asked(path: Path, run: Path, arm: str) -> Path:
    """The installation that a command reads while a daemon serves the one at ``path``."""

    async def status(_: Call) -> dict[str, Any]:
        return {"installation": str(path)}

    async def told() -> Path:
        server = Server({"status": Command(status, looks_only=True)}, control_socket(run, arm), look_socket(run, arm))
        await server.start()
        try:
            return (await asyncio.to_thread(installation_of, None)).path
        finally:
            await server.close()

    return asyncio.run(told())


def test_the_running_arm_may_be_of_ones_own_folder(house: Any) -> None:
    own = house.arm_files()
    own.write_text(own.read_text().replace('name = "dda"', 'name = "mine"', 1))
    assert _asked(own, run_directory(), "mine") == load_installation(str(own)).path


def test_without_a_daemon_the_first_arm_is_meant(house: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert installation_of(None).arm.name == "dda"
    monkeypatch.setenv("ETUDE_ARM", "puma600")
    assert installation_of(None).arm.name == "puma600"
    assert installation_of("seven").arm.name == "seven"
