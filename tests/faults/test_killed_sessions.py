"""Killed at random points of a session: what is left is valid, the next session works, a practice is carried on.

In full 200 points, over motions, practices and diagnoses, whose models are kept, in campaigns of 25, each over a state
directory of its own (``-k seed4`` runs one); what was hit is printed (pytest -s).
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from service.supervision import SupervisedProcess
from tests.faults.killed_sessions import Campaign, campaign

FULL = os.environ.get("ETUDE_FAULTS") == "full"
POINTS = 25 if FULL else 3
"""Of each campaign."""
SEEDS = range(4, 12) if FULL else (4,)
OTHERS_EVERY = 20
"""Of so many sessions two are practices and one a diagnosis, which take much longer than a motion."""
DIAGNOSIS = {"motions": ["dda-identify-2"], "budget": 0}
pytestmark = pytest.mark.timeout(7200 if FULL else 600)
MOTION = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.0, 2.2, 1.2]]
duration_s = [0.6]
"""


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Directories of the test's own under a short path (AF_UNIX), with the stand-in up."""
    with tempfile.TemporaryDirectory(prefix="etude-k") as name:
        folder = Path(name)
        for key, sub in (("ETUDE_RUN", "run"), ("ETUDE_STATE", "state")):
            (folder / sub).mkdir()
            monkeypatch.setenv(key, str(folder / sub))
        monkeypatch.delenv("ETUDE_ARM", raising=False)
        (folder / "short.toml").write_text(MOTION)
        with (folder / "stand-in.log").open("wb") as log:
            stand_in = SupervisedProcess(["virtual", "--config", "dda", "--lockstep"], log=log.fileno())
        try:
            stand_in.wait_ready(120)
            yield folder
        finally:
            stand_in.stop()


def one(lives: Campaign, number: int, motion: str) -> None:
    if FULL and number % OTHERS_EVERY in (3, 13):
        session = lives.killed("practise", {"motion": motion, "trials": 1, "replays": 5})
        if session is not None:
            lives.resumed(session, {"motion": motion, "trials": 1})
    elif FULL and number % OTHERS_EVERY == 7:
        lives.killed("diagnose", DIAGNOSIS)
    else:
        lives.killed("run", {"motion": motion})


@pytest.mark.parametrize("seed", SEEDS, ids="seed{}".format)
def test_killed_at_random_points(folder: Path, seed: int) -> None:
    motion = str(folder / "short.toml")
    began_s = time.monotonic()
    with campaign(folder, seed) as lives:
        if FULL:
            lives.done("diagnose", DIAGNOSIS)
            print(f"{lives.check_models()} models to begin with", flush=True)
        for number in range(POINTS):
            one(lives, number, motion)
            print(f"{number + 1} points, {time.monotonic() - began_s:.0f} s: {dict(lives.seen)}", flush=True)
        last = lives.store.open(lives.done("run", {"motion": motion})["session"])
        assert last.record.state == "done"
        for session in lives.store.all():
            lives.check(session)
        assert lives.check_models() >= FULL
        assert not [
            d for d in lives.store.directory.iterdir() if not (d / "session.json").exists() and any(d.iterdir())
        ]
    endings = {key: count for key, count in lives.seen.items() if key.startswith("session ")}
    assert 0 < sum(endings.values()) <= POINTS
    assert lives.seen["recordings read"] > 0
