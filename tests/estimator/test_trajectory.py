"""What a recording must be, and how its gaps part it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from config import InputError
from estimator import Trajectory


def recording(samples: int = 1000, joints: int = 2) -> dict[str, np.ndarray]:
    t = np.arange(samples) / 1000.0
    return {"t": t, "q": np.zeros((samples, joints)), "tau": np.zeros((samples, joints))}


def test_gaps_and_missing_samples_part_a_recording() -> None:
    data = recording()
    data["t"][400:] += 0.5
    data["tau"][700:730, 1] = np.nan
    data["q"][100] = np.nan
    trajectory = Trajectory(**data)
    pieces = list(trajectory.segments(longest=10_000, overlap=0))
    assert [(piece[0], piece[-1]) for piece in pieces] == [(0, 399), (400, 699), (730, 999)]
    assert len(pieces[0]) == 399
    assert trajectory.missing() == (31, 2)


def test_long_runs_are_cut_with_overlap_and_lose_nothing() -> None:
    pieces = list(Trajectory(**recording()).segments(longest=300, overlap=40))
    assert all(len(piece) <= 300 for piece in pieces)
    assert all(len(np.intersect1d(a, b)) == 40 for a, b in itertools.pairwise(pieces))
    np.testing.assert_array_equal(np.unique(np.concatenate(pieces)), np.arange(1000))


def test_nothing_usable_gives_no_pieces() -> None:
    data = recording()
    data["tau"][:, 0] = np.nan
    assert list(Trajectory(**data).segments(1000, 0)) == []


def test_commanded_motion_counts_only_where_it_is_needed() -> None:
    data = recording()
    data["q_desired"] = data["q"].copy()
    data["q_desired"][:500] = np.nan
    trajectory = Trajectory(**data)
    assert [len(piece) for piece in trajectory.segments(2000, 0)] == [1000]
    assert [len(piece) for piece in trajectory.segments(2000, 0, commanded=True)] == [500]


def test_wrong_recordings_are_named() -> None:
    data = recording()
    with pytest.raises(InputError, match=r"arm\.csv: tau has shape"):
        Trajectory(**{**data, "tau": data["tau"][:, :1]}, name="arm.csv")
    with pytest.raises(InputError, match="q has shape"):
        Trajectory(**{**data, "q": data["q"][:-1]})
    backwards = data["t"].copy()
    backwards[500] = backwards[498]
    with pytest.raises(InputError, match="time does not rise at sample 500"):
        Trajectory(**{**data, "t": backwards})
    with pytest.raises(InputError, match="convert degrees"):
        Trajectory(**{**data, "q": data["q"] + 430.0})
    with pytest.raises(InputError, match="has 5 samples"):
        Trajectory(**{name: channel[:5] for name, channel in data.items()})


@pytest.mark.parametrize("channel", ["tau", "dq", "ddq"])
def test_a_damaged_number_is_named(channel: str) -> None:
    t = np.arange(100) / 100.0
    values = {name: np.zeros((100, 2)) for name in ("tau", "dq", "ddq")}
    values[channel][40, 1] = -1e200
    values[channel][41, 1] = np.nan
    with pytest.raises(InputError, match=f"{channel} holds values beyond 1e.09; check that column"):
        Trajectory(t, np.zeros((100, 2)), **values)
