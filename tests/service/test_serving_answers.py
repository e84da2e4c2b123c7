"""Commands that go on serving answer once they are ready, so that a script can wait for them."""

from __future__ import annotations

import json
import signal
from typing import Any

from config.loader import installation_path


def test_up_answers_on_standard_output_while_it_serves(house: Any) -> None:
    up = house.popen("up", "--virtual", "--lockstep", "--arm", "dda", "--json", "-")
    assert up.stdout is not None
    answer = json.loads(up.stdout.readline())
    assert up.poll() is None
    assert answer["arm"] == "dda"
    assert answer["installation"] == str(installation_path("dda"))
    assert answer["virtual"] and answer["lockstep"]
    assert answer["socket"] == str(house.folder / "run" / "dda.sock")
    running = {process["name"]: process["pid"] for process in answer["processes"]}
    assert list(running) == ["virtual", "daemon"]
    assert running == {name: house.process(f"service\0{name}\0".encode()) for name in running}
    assert house.answer("status")["state"] == "idle"
    up.send_signal(signal.SIGINT)
    rest, told = up.communicate(timeout=60)
    assert up.returncode == 0, told
    assert rest == "", "what the processes say is on standard error"
    assert "arm dda is up" in told


def test_up_that_cannot_begin_answers_nothing(house: Any, start: Any) -> None:
    start("virtual")
    target = house.folder / "up.json"
    assert house.etude("up", "--virtual", "--lockstep", "--arm", "dda", "--json", str(target)).returncode == 2
    assert not target.exists()


def test_the_answers_are_there_when_readiness_is_told(house: Any, start: Any) -> None:
    common = {"arm": "dda", "installation": str(installation_path("dda")), "lockstep": True}
    target = house.folder / "answer.json"
    options = ("--config", "dda", "--lockstep", "--arm", "dda", "--json", str(target))
    virtual = start("virtual", *options, "--seed", "3")
    assert json.loads(target.read_text()) == {
        **common,
        "pid": virtual.process.pid,
        "seed": 3,
        "buses": [{"name": f"can{k}", "channel": f"local:dda-can{k}"} for k in range(3)],
        "lines": [{"name": "wrist", "path": str(house.folder / "run" / "dda-wrist")}],
    }
    daemon = start("daemon", *options)
    socket = str(house.folder / "run" / "dda.sock")
    assert json.loads(target.read_text()) == {**common, "pid": daemon.process.pid, "socket": socket}


def test_a_daemon_on_its_own_answers_on_standard_output_alone(house: Any, start: Any) -> None:
    start("virtual")
    daemon = house.popen("daemon", "--config", "dda", "--lockstep", "--json", "-")
    assert daemon.stdout is not None
    answer = json.loads(daemon.stdout.readline())
    assert answer["pid"] == daemon.pid
    assert house.answer("status")["arm"] == answer["arm"]
    daemon.send_signal(signal.SIGTERM)
    rest, told = daemon.communicate(timeout=60)
    assert (daemon.returncode, rest) == (0, ""), told
