"""What a diagnosis says first: nothing more than it knows."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from estimator.diagnosis.telling.answer import Diagnosis, Finding, HeldOut, Quantity, Residual, Unexplained, Verdict
from estimator.diagnosis.telling.traces import Traces
from estimator.effects import Place
from service.diagnosis.json_answer import as_json
from service.diagnosis.sentences import sentence_of, share_text, summary
from service.reports.diagnosis_tables import diagnosis_report


def diagnosis(verdict: Verdict, before: float, unexplained: dict[int, Unexplained] | None = None) -> Diagnosis:
    """Of two joints without a cause; the second's residual falls to its noise by the links' tolerance alone."""
    nothing = np.zeros((4, 2))
    return Diagnosis(
        joints=("shoulder", "elbow"),
        verdict=verdict,
        findings=(),
        unexplained=unexplained or {},
        torque_residual=(Residual(0.1, 0.1, 0.1, "N·m"), Residual(before, 0.2, 0.2, "N·m")),
        held_out=HeldOut(before, 0.2, None),
        smallest_detectable={},
        detectable_units={},
        notes=(),
        traces=Traces(0, np.arange(4.0), nothing, nothing, np.ones(2), ()),
        band=10.0,
        base_deviation=np.zeros(3),
    )


def test_a_clean_model_that_needs_its_tolerance_is_said_to() -> None:
    assert summary(diagnosis("clean", 0.21)) == "nothing beyond the noise: the model explains these recordings"
    told = summary(diagnosis("clean", 3.6))
    assert "what the links' tolerance allows" in told
    assert "at joint elbow 3.6 → 0.2 N·m rms" in told
    assert "--tolerance" in told


def test_several_joints_are_told_line_by_line() -> None:
    left = {0: Unexplained(0.004, "a function of speed"), 1: Unexplained(0.61, "a function of time")}
    answer = {**as_json(diagnosis("unknown", 3.6, left), []), "experiments": [], "report": None}
    console = Console(width=200)
    with console.capture() as shown:
        console.print(*diagnosis_report(answer), sep="\n")
    lines = [line.rstrip() for line in shown.get().splitlines()]
    assert lines[0] == "unknown: no cause has a name"
    assert "- shoulder: less than 1 % of what can be explained there has no name (a function of speed)" in lines
    assert "- elbow: 61 % of what can be explained there has no name (a function of time)" in lines


@pytest.mark.parametrize(("share", "text"), [(0.0, "0 %"), (0.004, "less than 1 %"), (0.86, "86 %"), (1.0, "100 %")])
def test_a_share_that_is_there_never_reads_nothing(share: float, text: str) -> None:
    assert share_text(share) == text


def test_a_shared_rotor_is_told_without_the_friction_that_it_has_not() -> None:
    parameters = {
        "joint_other": Quantity(1.0, 0.0, "–"),
        "ratio": Quantity(1.021, 0.024, "–"),
        "coefficient": Quantity(0.0, 0.0003, "N·m·s/rad"),
        "level": Quantity(0.0, 0.0004, "N·m"),
        "inertia": Quantity(0.00698, 0.00024, "kg·m²"),
    }
    found = Finding("transmission_coupling", Place(0, other=1), "named", parameters, 2136.0, 0.0, 1.0, (), (), None)
    assert sentence_of(found, ("shoulder", "elbow")) == (
        "joints shoulder and elbow have transmission coupling: ratio 1.021 ± 0.024, inertia 0.00698 ± 0.00024 kg·m²; "
        "it explains 100 % of what can be explained there"
    )


@pytest.mark.parametrize(("error", "one"), [(0.15, True), (0.2, False)])
def test_what_follows_from_one_unknown_is_told_with_one_error(error: float, one: bool) -> None:
    parameters = {name: Quantity(0.0, 0.0, "kg·m²") for name in ("I_xx", "I_xy", "I_xz", "I_yy")}
    parameters |= {"m": Quantity(3.0, 0.3, "kg"), "mx": Quantity(np.array([-1.5, 0.0]), np.array([error, 0.0]), "kg·m")}
    found = Finding("link_inertia", Place(1), "named", parameters, 90.0, 0.0, 1.0, (), (), None)
    assert ("one unknown, and one error" in sentence_of(found, ("shoulder", "elbow"))) is one
