"""Motion files: the thesis' own as golden numbers, joints by name, every mistake named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config import InputError, Installation, load_installation
from config.motion import check_motion, known_motions, load_motion, sample


def write(folder: Path, text: str, name: str = "mine.toml") -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_learning_motion_of_table_6_1(dda: Installation) -> None:
    played = sample(load_motion("dda-practice", dda), 1000)
    np.testing.assert_allclose(played.q[[0, -1]], [[0.5, 5.0, 4.0], [4.5, 1.0, -0.5]], atol=1e-12)
    assert played.duration_s == 1.5 and len(played.t) == 1501
    middle = len(played.t) // 2
    np.testing.assert_allclose(played.dq[middle], [5.0, -5.0, -5.625], atol=1e-9)
    np.testing.assert_allclose(np.abs(played.ddq).max(0), [10.26, 10.26, 11.55], atol=0.01)


@pytest.mark.parametrize(
    ("name", "first", "last", "seconds"),
    [
        ("dda-identify-1", (330, 289.1, 230), (80, 39.1, -10), 1.3),
        ("dda-identify-2", (330, 269.1, -30), (80, 19.1, 220), 1.3),
        ("dda-identify-3", (80, 269.1, -30), (330, 19.1, 220), 1.3),
        ("dda-controllers", (80, 269.1, -30), (330, 19.1, 220), 1.3),
        ("dda-load", (280, 269.1, -30), (80, 19.1, 220), 1.0),
    ],
)
def test_motions_of_the_thesis(dda: Installation, name: str, first: tuple, last: tuple, seconds: float) -> None:
    played = sample(load_motion(name, dda), 1000)
    np.testing.assert_allclose(np.degrees(played.q[[0, -1]]), [first, last], atol=1e-9)
    assert played.duration_s == pytest.approx(seconds)


def test_controller_motion_has_the_published_peaks(dda: Installation) -> None:
    """Appendix A: 360 °/s and 854 °/s²."""
    played = sample(load_motion("dda-controllers", dda), 1000)
    assert np.degrees(np.abs(played.dq).max()) == pytest.approx(360, abs=1)
    assert np.degrees(np.abs(played.ddq).max()) == pytest.approx(854, abs=1)


def test_load_motion_of_the_puma() -> None:
    puma = load_installation("puma600")
    played = sample(load_motion("puma600-load", puma), 500)
    np.testing.assert_allclose(
        np.degrees(played.q[[0, -1]]), [[0, 0, 0, -90, 0, 0], [90, -60, 90, 90, 90, 90]], atol=1e-9
    )


def test_columns_are_joints_by_name_and_the_others_stay_at_home(dda: Installation, tmp_path: Path) -> None:
    text = 'kind = "polynomial"\njoints = ["joint3", "joint1"]\nway_points_rad = [[1, 2], [1.5, 3]]\nduration_s = 2'
    played = sample(load_motion(write(tmp_path, text), dda), 100)
    np.testing.assert_allclose(played.q[[0, -1]], [[2, dda.arm.home_rad[1], 1], [3, dda.arm.home_rad[1], 1.5]])
    assert not played.dq[:, 1].any()


def test_fourier_file(dda: Installation, tmp_path: Path) -> None:
    text = """kind = "fourier"
base_hz = 0.5
periods = 3
fade_s = 0.5
centre_rad = [3, 2.5, 1.5]
sine_rad = [[0.2, 0.1, 0], [0, 0, 0.1]]
cosine_rad = [[0, 0, 0.3], [0, 0.1, 0]]"""
    motion = load_motion(write(tmp_path, text), dda)
    assert motion.duration_s == pytest.approx(7)
    played = sample(motion, 1000)
    check_motion(played, dda)
    t = 0.5 + 2.3  # seconds after the rise: full amplitude
    w = np.pi
    wanted = [
        3 + 0.2 * np.sin(w * 2.3),
        2.5 + 0.1 * np.sin(w * 2.3) + 0.1 * np.cos(2 * w * 2.3),
        1.5 + 0.3 * np.cos(w * 2.3) + 0.1 * np.sin(2 * w * 2.3),
    ]
    np.testing.assert_allclose(played.q[round(t * 1000)], wanted, atol=1e-9)


def test_a_duration_between_samples_is_filled_by_rest(dda: Installation, tmp_path: Path) -> None:
    text = 'kind = "polynomial"\nway_points_rad = [[3, 2, 1], [3.1, 2, 1]]\nduration_s = 1.0005'
    played = sample(load_motion(write(tmp_path, text), dda), 1000)
    assert len(played.t) == 1002
    assert played.q[-1, 0] == pytest.approx(3.1) and played.dq[-1, 0] == 0


def recorded(dda: Installation, folder: Path, rows: str, extra: str = "") -> np.ndarray:
    (folder / "path.csv").write_text(rows)
    return sample(load_motion(write(folder, f'kind = "recorded"\nfile = "path.csv"\n{extra}'), dda), 500).q


def table(t: np.ndarray, q: np.ndarray, header: str = "t,tau_joint1,q_joint2,q_joint1,q_joint3") -> str:
    return "\n".join([header, *(",".join(f"{v:.9g}" for v in (a, 7.0, *row)) for a, row in zip(t, q, strict=True))])


def smooth_path(noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    t = np.linspace(10.0, 12.0, 401)
    x = (t - 10) / 2
    s = x**3 * (10 - 15 * x + 6 * x**2)
    q = np.column_stack([2 + s, 3 - s, 1 + 0 * s])
    return t, q + noise * np.random.default_rng(5).normal(size=q.shape)


def test_recorded_path_by_column_names(dda: Installation, tmp_path: Path) -> None:
    t, q = smooth_path()
    played = recorded(dda, tmp_path, table(t, q))
    at = np.linspace(0, 2, len(played))
    x = at / 2
    s = x**3 * (10 - 15 * x + 6 * x**2)
    np.testing.assert_allclose(played, np.column_stack([3 - s, 2 + s, 1 + 0 * s]), atol=1e-6)


def test_low_pass_makes_a_measured_path_playable(dda: Installation, tmp_path: Path) -> None:
    t, q = smooth_path(noise=1e-4)
    (tmp_path / "path.csv").write_text(table(t, q))
    raw = write(tmp_path, 'kind = "recorded"\nfile = "path.csv"')
    with pytest.raises(InputError, match=r"joint\d: acceleration"):
        check_motion(sample(load_motion(raw, dda), 1000), dda)
    smooth = write(tmp_path, 'kind = "recorded"\nfile = "path.csv"\ncutoff_hz = 8')
    played = sample(load_motion(smooth, dda), 1000)
    check_motion(played, dda)
    assert np.abs(played.q[:, 1] - np.interp(played.t, t - 10, q[:, 0])).max() < 1e-3


LINE = "{},7,2,3,1\n"
GOOD = "t,tau_joint1,q_joint2,q_joint1,q_joint3\n" + "".join(LINE.format(k / 100) for k in range(40))


@pytest.mark.parametrize(
    ("rows", "extra", "sentence"),
    [
        (GOOD.replace("q_joint3", "q_joint4"), "", r"path.csv, line 1: there is no column 'q_joint3'; did you mean"),
        (GOOD.replace("0.05,7,2", "0.05,7,nan"), "", r"line 7, column 'q_joint2': 'nan' is no finite number; mend"),
        (GOOD.replace("0.05,7,2", "0.05,7,two"), "", r"line 7, column 'q_joint2': 'two' is no finite number"),
        (GOOD.replace("0.05,7,2", "0.05,7"), "", r"line 7: has 4 columns where the header has 5; mend that row"),
        (GOOD.replace("0.05,", "0.04,"), "", r"line 7, column 't': time does not rise; remove or mend that row"),
        ("".join(GOOD.splitlines(True)[:9]), "", r"path.csv: has 8 samples; give at least 16"),
        ("", "", r"path.csv, line 1: there is no column 't'; none is known here"),
        (GOOD, "cutoff_hz = 60", r"has 100 samples a second, too few for cutoff_hz = 60; lower cutoff_hz"),
    ],
)
def test_mistakes_in_a_recorded_path(dda: Installation, tmp_path: Path, rows: str, extra: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        recorded(dda, tmp_path, rows, extra)


POINTS = "way_points_rad = [[3, 2, 1], [4, 2, 1]]"
FOURIER = 'kind = "fourier"\nbase_hz = 1\ncentre_rad = [3, 2, 1]\nsine_rad = [[0, 0, 0]]\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (POINTS, r"mine.toml: kind: is missing; choose one of polynomial, minimum_jerk, fourier, recorded"),
        ('kind = "linear"', r"kind: 'linear' is no kind of motion; choose one of"),
        (f'kind = "polynomial"\n{POINTS}', r"mine.toml: duration_s: is missing; add the key 'duration_s'"),
        ('kind = "polynomial"\nduration_s = 1', r"way_points_rad: and way_points_deg exclude each other; give exactly"),
        (f'kind = "polynomial"\n{POINTS}\nduration = 1', r"duration: is not a key .*; did you mean 'duration_s'\?"),
        (f'kind = "polynomial"\n{POINTS}\nduration_s = [1, 2]', r"duration_s: has 2 durations for 1 stretches"),
        (f'kind = "polynomial"\n{POINTS}\nduration_s = -1', r"duration_s\[0\]: -1 is out of range; give more than 0"),
        (f'kind = "polynomial"\n{POINTS}\nduration_s = 1\norder = 6', r"order: 6 is none of 5 or 7; choose one"),
        (
            f'kind = "polynomial"\n{POINTS}\nduration_s = 1\narm = "seven"',
            r"arm: it is made for seven, this arm is dda",
        ),
        (
            f'kind = "polynomial"\n{POINTS}\nduration_s = 1\njoints = ["joint1", "joint7", "joint3"]',
            r"joints\[1\]: 'joint7' is no joint of dda; did you mean",
        ),
        (
            f'kind = "polynomial"\n{POINTS}\nduration_s = 1\njoints = ["joint1", "joint2", "joint1"]',
            r"joints\[2\]: 'joint1' is named twice; name each joint once",
        ),
        (
            'kind = "minimum_jerk"\nway_points_deg = [[3, 2, 1], [3, 2]]\nduration_s = 1',
            r"way_points_deg\[1\]: has 2 values for 3 joints; give one each for joint1, joint2, joint3",
        ),
        (
            'kind = "minimum_jerk"\nway_points_deg = [[3, 2, 1]]\nduration_s = 1',
            r"way_points_deg: has a single way point",
        ),
        (f"{FOURIER}cosine_rad = [[0, 0, 0], [0, 0, 0]]", r"cosine_rad: has 2 harmonics where sine_rad has 1; give as"),
        (f"{FOURIER}cosine_rad = [[0, 0]]", r"cosine_rad\[0\]: has 2 values for 3 joints"),
        ('kind = "recorded"\nfile = "none.csv"', r"none.csv: cannot be read \(No such file or directory\)"),
    ],
)
def test_mistakes_in_a_motion_file(dda: Installation, tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        load_motion(write(tmp_path, text), dda)


def test_unknown_names_suggest_known_ones(dda: Installation) -> None:
    with pytest.raises(
        InputError, match=r"motion 'dda-practise': there is no such motion for dda; did you mean 'dda-pr"
    ):
        load_motion("dda-practise", dda)
    assert known_motions(dda) == (
        "dda-controllers", "dda-identify-1", "dda-identify-2", "dda-identify-3", "dda-load", "dda-load-poses",
        "dda-load-test", "dda-practice",
    )  # fmt: skip


def test_motions_beside_the_installation_come_first(dda: Installation, tmp_path: Path) -> None:
    (tmp_path / "motions").mkdir()
    text = 'kind = "polynomial"\nway_points_rad = [[3, 2, 1], [4, 2, 1]]\nduration_s = 9'
    write(tmp_path / "motions", text, "dda-load.toml")
    write(tmp_path / "motions", text, "wave.toml")
    moved = dda.model_copy(update={"path": tmp_path / "installation.toml"})
    assert load_motion("dda-load", moved).duration_s == 9
    assert {"wave", "dda-load", "dda-practice"} <= set(known_motions(moved))


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_rates(dda: Installation, rate_hz: float) -> None:
    with pytest.raises(InputError, match=r"motion dda-load: cannot be sampled at .* Hz; give a positive rate"):
        sample(load_motion("dda-load", dda), rate_hz)


def test_a_motion_longer_than_is_held_sample_by_sample_is_refused(dda: Installation, tmp_path: Path) -> None:
    text = 'kind = "polynomial"\nway_points_rad = [[3.5, 2.6, 1.7], [3.2, 2.4, 1.4]]\nduration_s = {}\n'
    assert load_motion(write(tmp_path, text.format(3600)), dda).duration_s == 3600.0
    with pytest.raises(InputError, match=r"mine\.toml: lasts 1e\+09 s, and a motion 3600 s at most; play it in parts"):
        load_motion(write(tmp_path, text.format(1e9)), dda)
