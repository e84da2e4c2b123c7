"""Every mechanics file that ships fits its arm, holds it at home and lets it move within reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import config
import virtual_hw.hidden
from config import InputError, Installation, load_installation
from virtual_hw.hidden import load_hidden
from virtual_hw.plant import build_plant

ARMS = Path(config.__file__).parent / "arms"
FILES = sorted(p.stem for p in Path(virtual_hw.hidden.__file__).parent.glob("*.toml"))


def installation_of(name: str) -> Installation:
    arm = name.split("-")[0]
    if not (ARMS / arm / "installation.toml").exists():
        pytest.skip(f"there is no installation of the arm {arm}")
    return load_installation(arm)


@pytest.mark.parametrize("name", FILES)
def test_the_arm_rests_at_home_and_is_steady_under_a_servo(name):
    installation = installation_of(name)
    plant = build_plant(installation, load_hidden(installation, name), 1)
    home = np.array(installation.arm.home_rad)
    for _ in range(200):
        plant.advance([0.0] * plant.n, [True] * plant.n)
    np.testing.assert_allclose(plant.true_state()[0], home, atol=1e-3)
    stiffness = np.array([j.digital.stiffness_nm_rad for j in installation.joint])
    damping = np.array([j.digital.damping_nms_rad for j in installation.joint])
    q, dq = (np.array(x) for x in plant.true_state())
    for _ in range(2000):
        tau = stiffness * (home - q) - damping * dq
        plant.advance(tau.tolist(), [False] * plant.n)
        q, dq = (np.array(x) for x in plant.true_state())
    assert np.abs(q - home).max() < 0.2
    assert np.abs(dq).max() < 0.01


@pytest.mark.parametrize("name", [n for n in FILES if n.endswith("-clean")])
def test_a_clean_arm_has_noise_and_no_friction(name):
    installation = installation_of(name)
    hidden = load_hidden(installation, name)
    assert not (hidden.friction or hidden.cogging or hidden.torque_ripple or hidden.elasticity)
    plant = build_plant(installation, hidden, 1)
    torques = []
    for _ in range(100):
        plant.advance([0.0] * plant.n, [True] * plant.n)
        torques.append([plant.torque(i) for i in range(plant.n)])
    assert (np.std(torques, axis=0) > 0).all()


def test_a_stand_in_that_hides_nothing_is_the_urdf_and_its_wrist_sensor_lives(tmp_path: Path) -> None:
    for path in (ARMS / "dda").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    file = tmp_path / "installation.toml"
    text = file.read_text()
    assert 'hidden = "dda"' in text
    file.write_text(text.replace('hidden = "dda"', ""))
    installation = load_installation(str(file))
    hidden = load_hidden(installation)
    assert not hidden.link
    assert not hidden.friction
    assert [(w.sensor, w.force_noise.white > 0, w.torque_noise.white > 0) for w in hidden.wrench_sensor] == [
        ("wrist", True, True)
    ]
    file.write_text(text.replace('[virtual]\nhidden = "dda"', ""))
    with pytest.raises(InputError, match=r"add a section \[virtual\]"):
        load_hidden(load_installation(str(file)))
