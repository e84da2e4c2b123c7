"""The page of a diagnosis: what the simulation gets wrong and why, read in a minute."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10
from pathlib import Path
from typing import Any

import numpy as np

from estimator.diagnosis.telling.traces import Traces
from service.diagnosis.sentences import FEW, share_text
from service.reports.diagnosis_experiments import experiments_section, open_question
from service.reports.diagnosis_figures import alternatives_figure, residual_figure, signature_figure
from service.reports.diagnosis_overview import AT_A_GLANCE, anchor, overview
from service.reports.link_tables import figure
from service.reports.page import Html, badge, element, folded, html, joined, page, section, table

Answer = Mapping[str, Any]

TITLES = {
    "clean": "The simulation of {arm} is right, as far as these recordings can tell",
    "named": "What the simulation of {arm} gets wrong",
    "ambiguous": "What the simulation of {arm} gets wrong, and what is still open",
    "unknown": "The simulation of {arm} misses something that has no name yet",
}


def diagnosis_page(answer: Answer, traces: Traces | None) -> str:
    """The page as HTML, from the JSON answer of `diagnose` and the arrays beside it, without which it has no plots
    but those of the alternatives.
    """
    held_out = answer["gain"]["held_out_torque"]
    cards = [_finding(number, finding, traces) for number, finding in enumerate(answer["findings"])]
    rest = [_unexplained(answer)] if answer["unexplained"] else []
    rest += [experiments_section(answer["experiments"])] if answer["experiments"] else []
    whole = [] if traces is None else [_residual(answer, traces)]
    whole.append(_gain(answer))
    if len(cards) > AT_A_GLANCE:
        heading = element("h2", "Cause by cause", of="between")
        sections = [overview(answer["findings"]), *rest, *whole, heading, *cards]
    else:
        sections = [*cards, *rest, *whole]
    sections += [_detectable(answer), _provenance(answer)]
    facts = {
        "verdict": answer["verdict"],
        "explained on held-out motion": _percent(held_out["share_of_explainable"]),
        "torques compared up to": f"{figure(answer['band_hz'])} Hz",
        "learnt from": _recordings(answer),
    }
    title = TITLES[answer["verdict"]].format(arm=answer["arm"])
    return page("Étude · diagnosis", title, _lead(answer), facts, sections)


def _lead(answer: Answer) -> Html:
    summary = [finding["sentence"] for finding in answer["findings"]]
    if not summary and not answer["unexplained"]:
        text = f"{_capital(answer['summary'])}. What would have been seen stands below."
    elif not summary:
        joints = ", ".join(answer["unexplained"])
        text = f"Something repeats in the torque of {joints} that no effect of the catalogue explains."
    else:
        held_out = answer["gain"]["held_out_torque"]
        share = held_out["share_of_explainable"]
        count = len(summary)
        text = (
            f"{'One cause' if count == 1 else f'{count} causes'} found. On motion that was not learnt from, the torque "
            f"residual falls from {figure(held_out['before_rms'])} to {figure(held_out['after_rms'])} "
            f"{held_out['unit']} rms: "
            + (
                "that motion shows nothing beyond the noise."
                if share is None
                else f"{_percent(share)} of what any model could explain."
            )
        )
    return joined([badge(answer["verdict"]), text])


def _finding(number: int, finding: Mapping[str, Any], traces: Traces | None) -> Html:
    sentence = element("p", badge(finding["status"]), _capital(finding["sentence"]), of="sentence")
    signature = traces.signatures[number] if traces is not None else None
    left = joined([signature_figure(number, signature)] if signature is not None else [])
    label = f"{finding['effect'].replace('_', ' ')} · {finding['joint'] or finding['channel'] or 'arm'}"
    right = [_parameters(finding)]
    if finding["alternatives"]:
        right += [
            alternatives_figure(number, label, finding["alternatives"]),
            element(
                "p",
                "Alternatives: nats that each is behind. In the shaded strip one is as good as the other.",
                of="caption",
            ),
        ]
    body = element("div", element("div", left), element("div", joined(right)), of="side") if left else joined(right)
    return Html(f'<div id="{anchor(number)}">{section("", sentence, body, _next(finding))}</div>')


def _parameters(finding: Mapping[str, Any]) -> Html:
    parameters = finding["parameters"]
    told = [name for name, quantity in parameters.items() if len(parameters) <= FEW or _stands_out(quantity)]
    rows = [
        [
            name.replace("_", " "),
            *_with_error(parameters[name]["value"], parameters[name]["standard_error"]),
            parameters[name]["unit"],
        ]
        for name in told
    ]
    if untold := [name.replace("_", " ") for name in parameters if name not in told]:
        rows.append([", ".join(untold), "not told one by one", "", ""])
    evidence = finding["evidence"]
    rows.append(["evidence", figure(evidence["log_likelihood_gain"]), "", "nats"])
    rows.append(["chance of a false alarm", _chance(evidence["false_alarm_probability"]), "", ""])
    return table(["parameter", "value", "± std. error", "unit"], rows, numbers=(1, 2))


def _stands_out(quantity: Mapping[str, Any]) -> bool:
    """Words do, and figures by their errors; of many parameters the others cannot be told one by one."""
    if isinstance(quantity["value"], str) or quantity["standard_error"] is None:
        return True
    values, errors = np.atleast_1d(quantity["value"]), np.atleast_1d(quantity["standard_error"])
    return bool(np.any(np.abs(values) > 2.0 * errors))


def _next(finding: Mapping[str, Any]) -> Html:
    experiment = finding["next_experiment"]
    if not experiment:
        return Html("")
    return element("p", element("b", "To decide: "), *open_question(experiment), of="next")


def _unexplained(answer: Answer) -> Html:
    items = [
        element(
            "li", element("b", joint), f": {share_text(left['share'])} of what can be explained there has no name. "
        )
        + html(_capital(left["signature"]))
        for joint, left in answer["unexplained"].items()
    ]
    return section("What has no name", element("p", badge("unknown"), "Repeatable, beyond the noise, and by no law of "
                   "the catalogue.", of="sentence"), element("ul", *map(Html, items)))  # fmt: skip


def _residual(answer: Answer, traces: Traces) -> Html:
    caption = element(
        "p",
        f"Measured less predicted, {_shown(answer, traces)}. Inside the shaded band nothing is left to explain.",
        of="caption",
    )
    return section(
        "Torque residual, before and after" if answer["findings"] else "Torque residual",
        element("div", residual_figure(traces, _units(answer), bool(answer["findings"])), of="wide"),
        caption,
    )


def _units(answer: Answer) -> dict[str, str]:
    """Of each joint's torque."""
    return {joint: r["unit"] for joint, r in answer["torque_residual"].items()}


def _gain(answer: Answer) -> Html:
    rows = []
    for joint, r in answer["torque_residual"].items():
        largest = max(r["before_rms"], 1e-300)
        bars = (("before", 1.0), ("after", r["after_rms"] / largest), ("noise", r["noise_rms"] / largest))
        bar = "".join(f'<i class="{name}" style="width:{100 * min(1.0, share):.1f}%"></i>' for name, share in bars)
        numbers = [figure(r[key]) for key in ("before_rms", "after_rms", "noise_rms")]
        rows.append([joint, *numbers, r["unit"], Html(f'<div class="bar">{bar}</div>')])
    held_out = answer["gain"]["held_out_torque"]
    rows.append([element("b", "held out"), figure(held_out["before_rms"]), figure(held_out["after_rms"]), "",
                 held_out["unit"], _explained(held_out["share_of_explainable"])])  # fmt: skip
    simulation = answer["gain"]["simulation"]
    if simulation:
        off = [
            f"{figure(simulation[key])} {simulation['unit']}" for key in ("position_before_rms", "position_after_rms")
        ]
        rows.append([element("b", "simulated position"), *off, "", "", "the twin with the recorded commands"])
    tracking = answer["gain"].get("tracking")
    if tracking:
        off = [f"{figure(tracking[key])} {tracking['unit']}" for key in ("position_before_rms", "position_after_rms")]
        rows.append(
            [element("b", "position on the arm"), *off, "", "", f"{tracking['motion']} under the model's feedforward"]
        )
    heading = "What it gains" if answer["findings"] else "Torques against their noise"
    headings = ["joint", "before, rms", "after", "noise", "unit", "red: what is left; black mark: the noise"]
    return section(heading, table(headings, rows, numbers=(1, 2, 3)))


def _detectable(answer: Answer) -> Html:
    sizes: Mapping[str, Mapping[str, float]] = answer["smallest_detectable"]
    if not sizes:
        return Html("")
    units: Mapping[str, str] = answer["smallest_detectable_units"]
    joints = list(dict.fromkeys(joint for by_joint in sizes.values() for joint in by_joint))
    rows = [
        [effect.replace("_", " "), *(figure(by_joint[j]) if j in by_joint else "" for j in joints), units[effect]]
        for effect, by_joint in sizes.items()
    ]
    tables = table(["effect", *joints, "unit"], rows, numbers=range(1, len(joints) + 1))
    heading = "What would have been seen"
    caption = element("p", "The smallest size of each effect that these recordings would have shown.", of="caption")
    if answer["verdict"] == "clean":
        return section(heading, tables, caption)
    return section("", folded(heading, tables, caption))


def _provenance(answer: Answer) -> Html:
    items = [element("li", _capital(note)) for note in answer["notes"]]
    items += [element("li", "Model: ", element("span", str(answer["model"]), of="path"))] if answer["model"] else []
    return section("What this rests on", element("ul", *items)) if items else Html("")


def _shown(answer: Answer, traces: Traces) -> str:
    """Which recording it is."""
    held_out = answer["hold_out"]
    name = Path((held_out or answer["recordings"])[traces.recording]).name
    return f"in {name}, which was not learnt from" if held_out else f"in {name}"


def _recordings(answer: Answer) -> str:
    count = len(answer["recordings"])
    return f"{count} recording{'s' * (count != 1)}" if count else ""


def _with_error(value: Any, error: Any) -> tuple[str, str]:
    """A parameter and its standard error: the error with two digits, the value to the same place."""
    if isinstance(value, str):
        return value, ""
    if isinstance(value, list):
        pairs = [_with_error(v, e) for v, e in zip(value, error, strict=True)]
        return ", ".join(v for v, _ in pairs), ", ".join(e for _, e in pairs)
    if value is None or not error or not 1e-9 < abs(error) < 1e9:
        return figure(value), "" if error is None else figure(error)
    places = max(0, 1 - floor(log10(error)))
    return (f"{value:.{places}f}", f"{error:.{places}f}") if places < 7 else (f"{value:.3g}", f"{error:.2g}")


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.0f} %"


def _explained(share: float | None) -> str:
    return "nothing beyond the noise" if share is None else f"{_percent(share)} of the explainable"


def _chance(probability: float | None) -> str:
    return "–" if probability is None else "< 0.001" if probability < 1e-3 else f"{probability:.2g}"


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
