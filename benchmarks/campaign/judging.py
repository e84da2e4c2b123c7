"""The opened answer beside the finder's. Pure functions on the truth and the finder's JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.campaign.cause import Named
from benchmarks.campaign.scenario import TrueCause, Truth

Outcome = Literal["named", "in a set", "missed"]


@dataclass(frozen=True)
class ParameterError:
    """Of a parameter that a right finding gave: estimate − truth, its standard error, and the truth."""

    name: str
    error: float
    standard_error: float
    truth: float


@dataclass(frozen=True)
class AmbiguousSet:
    """How many causes an ambiguous finding leaves, and whether a true one is among them."""

    size: int
    holds: bool


@dataclass(frozen=True)
class Judgement:
    """One scenario, judged.

    Attributes:
        outcomes: of each cause that the catalogue has.
        wrong: causes that were named and are not there.
        flagged: whether it was said that something has no name.
        gain: share of the explainable that the finder's model explains of the held-out motion. The truth itself
            explains all of it, so this is the gain beside that of an oracle who knows cause and parameters.
        sentence: truth and answer, for a reader.
    """

    truth: Truth
    verdict: str
    outcomes: tuple[Outcome, ...]
    wrong: tuple[Named, ...]
    sets: tuple[AmbiguousSet, ...]
    flagged: bool
    parameters: tuple[ParameterError, ...]
    gain: float | None
    seconds: float
    sentence: str

    @property
    def alarm(self) -> bool:
        """Whether something was found, named or not, beyond what is excused."""
        return self.flagged or bool(self.wrong) or not all(one.holds for one in self.sets)

    @property
    def clean(self) -> bool:
        return not self.truth.causes

    @property
    def outside(self) -> bool:
        """Whether it has a cause that the catalogue does not have."""
        return any(not cause.answers for cause in self.truth.causes)

    @property
    def outside_flagged(self) -> bool | None:
        """Of a scenario with an outside cause, whether it was said that something has no name."""
        return self.flagged if self.outside else None

    @property
    def right(self) -> bool:
        """Every cause named on its joint, and nothing else."""
        return not self.wrong and all(outcome == "named" for outcome in self.outcomes)

    @property
    def size(self) -> float:
        """Of the largest cause, in multiples of the noise."""
        return max((cause.size for cause in self.truth.causes), default=0.0)


def judge(truth: Truth, answer: Mapping[str, Any], seconds: float) -> Judgement:
    """Hold the finder's ``answer`` (as `diagnose --json` gives it) against the truth."""
    findings: Sequence[Mapping[str, Any]] = answer["findings"]
    inside = [cause for cause in truth.causes if cause.answers]
    rightful = frozenset().union(*(cause.answers for cause in inside))
    excused = truth.excused.union(*(cause.excused for cause in truth.causes))
    named = [_named(finding) for finding in findings if finding["status"] == "named"]
    sets = _sets(findings)
    return Judgement(
        truth=truth,
        verdict=str(answer["verdict"]),
        outcomes=tuple(_outcome(cause, named, sets) for cause in inside),
        wrong=tuple(name for name in named if name not in rightful | excused),
        sets=tuple(AmbiguousSet(len(one), bool(one & (rightful | excused))) for one in sets),
        flagged=bool(answer["verdict"] == "unknown" or answer["unexplained"]),
        parameters=tuple(error for cause in inside for error in _parameter_errors(cause, findings)),
        gain=_gain(answer),
        seconds=seconds,
        sentence=f"{_told_truth(truth)} → {_told_answer(answer)}",
    )


def undecided(truth: Truth, answer: Mapping[str, Any]) -> bool:
    """Whether an ambiguous set of the ``answer`` holds names that do not all mean the same thing, and right: a rotor
    and the inertia of the first link are told apart by no motion."""
    return any(not any(one <= cause.answers for cause in truth.causes) for one in _sets(answer["findings"]))


def _sets(findings: Sequence[Mapping[str, Any]]) -> list[frozenset[Named]]:
    """Each ambiguous finding with its alternatives."""
    return [
        frozenset({_named(finding), *(_named(other) for other in finding["alternatives"])})
        for finding in findings
        if finding["status"] == "ambiguous"
    ]


def _named(finding: Mapping[str, Any]) -> Named:
    return str(finding["effect"]), finding["joint"]


def _outcome(cause: TrueCause, named: Sequence[Named], sets: Sequence[frozenset[Named]]) -> Outcome:
    if any(name in cause.answers for name in named):
        return "named"
    # Where all names that are left mean the same thing, there is nothing to decide.
    if any(one <= cause.answers for one in sets):
        return "named"
    return "in a set" if any(one & cause.answers for one in sets) else "missed"


def _parameter_errors(cause: TrueCause, findings: Sequence[Mapping[str, Any]]) -> list[ParameterError]:
    # Of several right answers only the effect that the parameters belong to can be compared.
    effect = cause.label.partition(":")[0]
    right = [f for f in findings if f["status"] == "named" and f["effect"] == effect and _named(f) in cause.answers]
    if not right:
        return []
    # Of several lines of a spectrum, the one that stands out: others are its form.
    told = max(right, key=lambda finding: float(finding["evidence"]["log_likelihood_gain"]))["parameters"]
    return [
        ParameterError(name, told[name]["value"] - truth, told[name]["standard_error"], truth)
        for name, truth in cause.parameters.items()
        if name in told and told[name]["standard_error"] is not None
    ]


def _gain(answer: Mapping[str, Any]) -> float | None:
    held_out = answer["gain"]["held_out_torque"] if answer.get("gain") else None
    return None if held_out is None else held_out["share_of_explainable"]


def _told_truth(truth: Truth) -> str:
    causes = ", ".join(f"{c.label} on {_where(c)} at {c.size:.2g}" for c in truth.causes) or "clean"
    return f"{truth.number:4d} {truth.arm} ({truth.scatter:.0%} scatter): {causes}"


def _where(cause: TrueCause) -> str:
    return "/".join(sorted({str(joint) for _, joint in cause.answers | cause.excused if joint})) or "the arm"


def _told_answer(answer: Mapping[str, Any]) -> str:
    told = []
    for finding in answer["findings"]:
        effect, joint = _named(finding)
        others = "".join(f" or {o['effect']} on {o['joint']}" for o in finding["alternatives"])
        told.append(f"{effect} on {joint}" + (others if finding["status"] == "ambiguous" else ""))
    unexplained = "".join(f"; unexplained on {joint}" for joint in answer["unexplained"])
    return f"{answer['verdict']}: {', '.join(told) or 'nothing named'}{unexplained}"
