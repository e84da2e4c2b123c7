"""A diagnosis in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from estimator.diagnosis.telling.answer import GEAR, MOTOR, Diagnosis, Finding, Quantity
from estimator.effects import Place, effect

FEW = 5
"""Parameters that a sentence takes without choosing."""
_VISIBLE = 2.0
"""Times the noise, or what is left: a residual of the given model that a reader sees, and asks about."""


def summary(diagnosis: Diagnosis) -> str:
    """What a person must know first."""
    if diagnosis.verdict == "clean":
        return _clean(diagnosis)
    parts = [sentence_of(finding, diagnosis.joints) for finding in diagnosis.findings]
    for joint, left in diagnosis.unexplained.items():
        where = place_text(Place(joint), diagnosis.joints, verb=False)
        what = f"{share_text(left.share)} of what can be explained there has no name ({left.signature})"
        parts.append(f"{where}: {what}")
    return "; ".join(parts)


def _clean(diagnosis: Diagnosis) -> str:
    """Of a model that explains the recordings, with what it takes for that: its links within their tolerance."""
    moved = {
        joint: r
        for joint, r in zip(diagnosis.joints, diagnosis.torque_residual, strict=True)
        if r.before > _VISIBLE * max(r.noise, r.after)
    }
    if not moved:
        return "nothing beyond the noise: the model explains these recordings"
    joint, worst = max(moved.items(), key=lambda item: item[1].before / max(item[1].noise, item[1].after))
    return (
        "nothing beyond the noise and what the links' tolerance allows: small changes of the link parameters take up "
        f"all that there is (at {place_text(Place(diagnosis.joints.index(joint)), diagnosis.joints, verb=False)} "
        f"{worst.before:.3g} → {worst.after:.3g} {worst.unit} rms); a model known better than that is judged with a "
        "smaller --tolerance, and identify links tells the links"
    )


def sentence_of(finding: Finding, joints: Sequence[str]) -> str:
    """ "joint 2 has viscous friction: coefficient 3.1 ± 0.2 N·m·s/rad; it explains 86 % of what can be explained"."""
    form = effect(finding.effect).form(finding.shape)
    told = _told(finding.parameters)
    values = ", ".join(f"{name.replace('_', ' ')} {quantity_text(q)}" for name, q in told.items())
    sentence = (
        f"{place_text(finding.place, joints)} {effect_text(finding.effect)}{form and f', {form}'}"
        f"{': ' if values else ''}{values}"
        f"{' (one unknown, and one error: they are in proportion)' if _in_proportion(told) else ''}; "
        f"it explains {share_text(finding.share_of_explainable)} of what can be explained there"
    )
    if finding.status == "ambiguous":
        near = finding.alternatives[0]
        sentence += f", but so might {effect_text(near.effect)} of {place_text(near.place, joints, verb=False)}"
    return sentence


def _told(parameters: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Those that the place does not name, without parts of a law that are not there; of many parameters those that
    stand out of their errors: the others the data do not tell one by one."""
    own = {name: q for name, q in parameters.items() if name != "joint_other" and np.any(np.atleast_1d(q.value) != 0.0)}
    if len(parameters) <= FEW:
        return own
    return {
        name: q
        for name, q in own.items()
        if np.any(np.abs(np.atleast_1d(q.value)) > 2.0 * np.atleast_1d(q.standard_error))
    }


def _in_proportion(told: Mapping[str, Quantity]) -> bool:
    """Whether all follow from one unknown, as the parameters of a link of another density do."""
    each = [(np.atleast_1d(q.value), np.atleast_1d(q.standard_error)) for q in told.values()]
    relative = np.array([e / abs(v) for pair in each for v, e in zip(*pair, strict=True) if v != 0.0])
    return len(relative) > 1 and bool(np.ptp(relative) < 1e-6 * np.max(relative))


def place_text(place: Place, joints: Sequence[str], verb: bool = True) -> str:
    """``joint elbow has``, or without the verb ``joint elbow``; of a drive ``the drive of joint elbow``, likewise of a
    gear."""
    if place.channel == MOTOR:
        inner = Place(place.joint, "motor torque" if place.joint is None else None)
        return ("" if place.joint is None else "the drive of ") + place_text(inner, joints, verb)
    if place.channel == GEAR:
        inner = Place(place.joint, "position" if place.joint is None else None)
        whose = " behind the gears" if place.joint is None else ""
        return ("" if whose else "the gear of ") + place_text(inner, joints, False) + whose + (" has" if verb else "")
    if place.joint is not None and place.other is not None:
        return f"joints {joints[place.joint]} and {joints[place.other]}" + (" have" if verb else "")
    if place.joint is not None:
        name = joints[place.joint]
        whose = "" if place.channel is None else f"the {place.channel} channel of "
        return whose + (name if name.startswith("joint") else f"joint {name}") + (" has" if verb else "")
    what = "the arm" if place.channel is None else f"the {place.channel} channel"
    return what + (" has" if verb else "")


def share_text(share: float) -> str:
    """``86 %``; what is there never reads 0 %."""
    return "less than 1 %" if 0.0 < share < 0.01 else f"{100 * share:.0f} %"


def effect_text(name: str) -> str:
    """``viscous friction``"""
    return name.replace("_", " ")


def quantity_text(quantity: Quantity) -> str:
    """``3.1 ± 0.2 N·m``, digits as the error allows."""
    values, errors = np.atleast_1d(quantity.value), np.atleast_1d(quantity.standard_error)
    texts = [_with_error(float(v), float(e)) for v, e in zip(values, errors, strict=True)]
    text = texts[0] if len(texts) == 1 else "(" + ", ".join(texts) + ")"
    return text if quantity.unit == "–" else f"{text} {quantity.unit}".rstrip()


def _with_error(value: float, error: float) -> str:
    if not (np.isfinite(error) and error > 0.0):
        return f"{value:.3g}"
    digits = int(np.clip(1 - np.floor(np.log10(error)), 0, 12))
    if digits > 6 or abs(value) >= 1e6:
        return f"{value:.3g} ± {error:.2g}"
    return f"{value:.{digits}f} ± {error:.{digits}f}"
