"""What the identified links lack, by the recordings that Appendix A's comparison makes of the arm at hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.bench_controllers import JOINT, MOTION, diagnosed
from estimator.diagnosis.telling.answer import Diagnosis
from service import outcomes


@pytest.fixture(scope="module")
def found(running_house: Any, tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """The recordings of an identification and of the comparison that followed, against the links identified."""
    links = running_house.answer("identify", "links")
    target = tmp_path_factory.mktemp("compared") / "answer.json"
    client = running_house.popen("compare-controllers", MOTION, "--model", links["model"], "--json", str(target))
    _, told = client.communicate(timeout=580)
    assert client.returncode == outcomes.DONE, told
    played = sorted(Path(json.loads(target.read_text())["plot"]).parent.glob("*.mcap"))
    with pytest.MonkeyPatch.context() as patch:
        for name, value in running_house.environment.items():
            patch.setenv(name, value)
        return diagnosed(links["model"], [*map(Path, links["recordings"]), *played])[1]


def test_the_stand_ins_friction_has_its_names(found: Diagnosis) -> None:
    """Bristles that bend over 0.6 mrad, a rise from rest, a viscous part, and an eighth more one way
    (virtual_hw/hidden/dda.toml): none is told that it does not have. A friction that would drift to less than nothing
    explains as much."""
    joint = found.joints.index(JOINT)
    told = [finding for finding in found.findings if finding.place.joint == joint]
    named = {finding.effect for finding in told if finding.status == "named"}
    either = {finding.effect for finding in told} | {a.effect for finding in told for a in finding.alternatives}
    has = {"coulomb_friction", "viscous_friction", "stribeck_friction", "asymmetric_friction", "presliding"}
    assert named <= has
    assert "presliding" in either
    assert either & {"stribeck_friction", "asymmetric_friction"}


def test_what_the_joint_lacks_is_explained(found: Diagnosis) -> None:
    """But for what its friction holds it by in rests, which bristles alone would tell, and no other law."""
    residual = found.torque_residual[found.joints.index(JOINT)]
    assert residual.after < 0.35 * residual.before
