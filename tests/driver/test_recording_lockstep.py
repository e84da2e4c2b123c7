"""The whole path in lockstep, stand-in to file: the same bytes twice, and replay gives them again."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from config import Installation
from config.motion import point_to_point
from driver.arm import ArmLoop
from driver.plan import Plan
from driver.recording import RecorderProcess, read_recording, replay

STANDIN = """
from config import load_installation
from virtual_hw.standin import run_standin
run_standin(load_installation("dda"), None, True, 3, lambda: print("ready", flush=True))
"""


def record_one_move(directory: Path, dda: Installation) -> Path:
    with subprocess.Popen([sys.executable, "-c", STANDIN], stdout=subprocess.PIPE, text=True) as standin:
        try:
            assert standin.stdout is not None
            assert standin.stdout.readline() == "ready\n"
            with (
                ArmLoop.start(dda, lockstep=True, ring_name="t") as arm,
                RecorderProcess.start(dda, "t", directory) as recorder,
            ):
                arm.enable("csp")
                q = np.array(arm.status().q)
                motion = point_to_point(q, q + 0.1, dda)
                recorder.start_run("move", metadata={"mode": "csp"})
                run = arm.play(Plan(motion.q, motion.dq, motion.ddq, mode="csp", controller="pd", name="move"))
                assert arm.wait(run).run_outcome == "done"
                path = recorder.stop_run()
                arm.disable()
                return path
        finally:
            standin.terminate()


def test_a_run_in_lockstep_is_recorded_to_the_byte(
    tmp_path: Path, dda: Installation, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        monkeypatch.setenv("ETUDE_RUN", str(tmp_path / name))
        paths.append(record_one_move(tmp_path / name, dda))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    report = replay(paths[0])
    assert report.identical, report.sentence
    recording = read_recording(paths[0])
    assert recording.gaps == ()
    assert not np.isnan(recording.q).any()
    assert recording.q_d is not None
    assert np.abs(recording.q_d[-1] - recording.q_d[0]) == pytest.approx(0.1, abs=0.01)
    assert recording.wrench is not None
    assert len(recording.wrench) == report.messages["/wrench"] > 0.9 * recording.t[-1] * 240
    assert not np.isnan(recording.wrench).any()
    assert recording.events[0].text == "playing"
