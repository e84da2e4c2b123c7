"""A CSV with the temperatures of joints: friction that falls while they warm, and torques that drift with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from driver.recording import read_recording
from driver.recording.csv_recording import write_csv
from service.diagnosis.diagnosing import diagnose_recordings
from service.diagnosis.request import DiagnoseRequest
from service.models.export import export_model
from service.models.model_file import read_model
from tests.service.pendulum import pendulum

Array = NDArray[np.float64]
Drift = Callable[[Array, Array], Array]
SECONDS, NOISE = 14.0, 0.1
COLD, WARMER_BY = 21.0, 25.0
"""°C: the elbow comes near to so much more while the recordings are made, and cools in the middle of them."""


def friction(temperature: Array, dq: Array) -> Array:
    """N·m; it falls to two fifths, by another law than the diagnosis has."""
    level = 1.0 + 1.5 * np.exp(-(temperature - COLD) / 9.0)
    return np.asarray(level * np.tanh(dq / 2e-3))


def sensor(temperature: Array, dq: Array) -> Array:
    """N·m that a torque sensor reads more."""
    return np.asarray(0.01 * (temperature - COLD) ** 1.5)


def by_its_work(t: Array) -> Array:
    """°C at times of the whole session."""
    return np.asarray(COLD + WARMER_BY * (1.0 - np.exp(-t / 35.0)) * (1.0 - 0.5 * np.exp(-(((t - 50.0) / 12.0) ** 2))))


def by_the_sun(t: Array) -> Array:
    """°C at such times, the same in each playing of a motion: clouds pass."""
    return np.asarray(COLD + 10.0 * (1.0 + np.sin(2.0 * np.pi * t / (0.75 * SECONDS))))


def recordings(folder: Path, drift: Drift, warmth: Callable[[Array], Array] = by_its_work) -> list[Path]:
    """Three motions, each played twice."""
    files = []
    for number in range(6):
        random, t = np.random.default_rng(number), np.arange(0.0, SECONDS, 0.005)
        w = 2.0 * np.pi * np.array([[0.11, 0.37, 0.83], [0.17, 0.29, 0.97]])
        of_motion = np.random.default_rng(50 + number % 3)
        a = np.array([[0.7, 0.4, 0.12], [0.8, 0.5, 0.15]]) * of_motion.uniform(0.8, 1.2, (2, 3))
        phase = w * t[:, None, None] + of_motion.uniform(0.0, 6.0, (2, 3))
        q, dq, ddq = ((f * a * w**k).sum(axis=2) for k, f in enumerate((np.sin(phase), np.cos(phase), -np.sin(phase))))
        temperature = warmth(t + number * SECONDS)
        tau = pendulum(q, dq, ddq) + NOISE * random.standard_normal(q.shape)
        tau[:, 1] += drift(temperature, dq[:, 1])
        columns = {"t": t, "q_shoulder": q[:, 0], "q_elbow": q[:, 1], "tau_shoulder": tau[:, 0], "tau_elbow": tau[:, 1]}
        columns["temperature_elbow"] = 0.1 * np.round(10.0 * temperature)
        files.append(folder / f"run-{number}.csv")
        np.savetxt(
            files[-1], np.column_stack(list(columns.values())), "%.9g", ",", header=",".join(columns), comments=""
        )
    return files


def diagnosed(files: list[Path], urdf: Path, directory: Path | None = None) -> dict:
    return diagnose_recordings(DiagnoseRequest(tuple(files), arm=str(urdf), directory=directory)).answer


def test_friction_that_goes_with_the_temperature_is_told_at_both_ends(tmp_path: Path, urdf: Path) -> None:
    answer = diagnosed(recordings(tmp_path, friction), urdf, tmp_path / "out")
    (drift,) = (f for f in answer["findings"] if f["effect"] == "friction_drift")
    assert (drift["joint"], drift["status"]) == ("elbow", "named")
    told = {name: p["value"] for name, p in drift["parameters"].items()}
    assert told["initial_temperature"] == pytest.approx(COLD, abs=0.2)
    assert told["final_temperature"] > COLD + 0.8 * WARMER_BY
    # A straight line through what falls by an exponential: from 2.5 to 1.1 N·m, and steeply while it is cold.
    assert 1.8 < told["initial"] < 2.5
    assert 0.9 < told["final"] < 1.3
    assert "°C" in answer["summary"]
    (page,) = (tmp_path / "out").glob("*.html")
    assert "temperature of elbow" in page.read_text(encoding="utf-8")
    exported = export_model(read_model(tmp_path / "out" / "model.toml"), tmp_path / "arm.xml")
    assert exported["not_written"] == ["friction_drift of elbow (only in part)"]


def test_of_motions_played_once_it_is_named_too(tmp_path: Path, urdf: Path) -> None:
    """A friction that drifts with time alone is told from one that goes with the place by repeats."""
    answer = diagnosed(recordings(tmp_path, friction)[:3], urdf)
    drifts = [f for f in answer["findings"] if f["effect"] == "friction_drift"]
    assert [(f["joint"], f["status"]) for f in drifts] == [("elbow", "named")]
    assert "initial_temperature" in drifts[0]["parameters"]


def test_a_torque_that_goes_with_the_temperature_is_flagged_so(tmp_path: Path, urdf: Path) -> None:
    answer = diagnosed(recordings(tmp_path, sensor, by_the_sun), urdf)
    assert answer["unexplained"]["elbow"]["signature"] == "a function of temperature"


def test_temperatures_that_some_recordings_lack_are_not_asked_after(tmp_path: Path, urdf: Path) -> None:
    files = recordings(tmp_path, friction)[:3]
    rows = [line.rpartition(",")[0] for line in files[0].read_text().splitlines()]
    files[0].write_text("\n".join(rows))
    answer = diagnosed(files, urdf)
    assert any("not every recording has the columns temperature_<joint>" in note for note in answer["notes"])
    assert not any("initial_temperature" in finding["parameters"] for finding in answer["findings"])


def test_temperatures_in_kelvin_are_refused(tmp_path: Path, urdf: Path) -> None:
    files = recordings(tmp_path, friction, lambda t: by_its_work(t) + 273.15)[:1]
    with pytest.raises(InputError, match=r"run-0\.csv.*a temperature of \d+ is no joint's in °C.*kelvin"):
        diagnosed(files, urdf)


def test_temperatures_are_read_and_written_of_those_joints_that_have_them(tmp_path: Path) -> None:
    (path, *_) = recordings(tmp_path, friction)
    read = read_recording(path)
    assert read.temperature is not None
    assert np.isnan(read.temperature[:, 0]).all()
    assert np.all(read.temperature[:, 1] >= COLD)
    assert not write_csv(read, tmp_path / "again.csv").quantities
    np.testing.assert_array_equal(read_recording(tmp_path / "again.csv").temperature, read.temperature)
    header, _, rest = path.read_text().partition("\n")
    path.write_text(header.replace("temperature_elbow", "temperature_wrist") + "\n" + rest)
    with pytest.raises(InputError, match="'temperature_wrist' is there without 'q_wrist'"):
        read_recording(path)
