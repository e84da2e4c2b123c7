"""A load put on while a practice was interrupted: the practice that is taken up notices, and learns nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.timeout(600)
SHORT = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.0, 2.2, 0.6]]
duration_s = [0.5]
"""
LOADED = """
extends = "dda"

[payload]
mass_kg = 4.0
centre_m = [0.0, 0.0, 0.05]
inertia_kg_m2 = [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]
"""


def test_another_load_is_noticed_and_not_learnt(house: Any, start: Any, tmp_path: Path) -> None:
    motion, hidden = tmp_path / "short.toml", tmp_path / "loaded.toml"
    motion.write_text(SHORT)
    hidden.write_text(LOADED)
    arm, daemon = (start(name, "--config", "dda", "--lockstep") for name in ("virtual", "daemon"))
    model = house.answer("identify", "links")["model"]
    before = house.answer("practise", str(motion), "--model", model, "--trials", "1")
    assert all(trial["learnt"] for trial in before["trials"])
    learnt = Path(before["feedforward"]).read_text()
    daemon.stop()
    arm.stop()
    start("virtual", "--config", "dda", "--lockstep", "--hidden", str(hidden))
    start("daemon", "--config", "dda", "--lockstep")
    after = house.answer("practise", str(motion), "--model", model, "--trials", "4", "--resume", before["session"])
    told = after["trials"][2:]
    assert [trial["learnt"] for trial in told] == [False, False]
    assert "has the load changed?" in told[0]["findings"][0]
    assert "the arm has changed" in after["stopped_because"]
    assert Path(after["feedforward"]).read_text() == learnt
