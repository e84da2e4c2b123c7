"""The pages of a practice and of a comparison of controllers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from service.practice.answers import taught_text
from service.reports.link_tables import figure
from service.reports.page import Html, badge, element, folded, joined, page, picture, section, table

Answer = Mapping[str, Any]


def practice_page(answer: Answer) -> str:
    """The page as HTML, from the JSON answer of `practise`: learning curve, torques, certificate."""
    floor = answer["repeatability"]
    first, last = (_times(trial, floor) for trial in (answer["trials"][0], answer["trials"][-1]))
    certificate = answer["certificate"]
    lead = joined(
        [
            badge("good" if last < first else "ambiguous", f"{last:.2f} × repeatability"),
            f"From {first:.2f} × repeatability with the model's feedforward, in {len(answer['trials']) - 1} practice "
            f"movements. Stopped because {answer['stopped_because']}.",
        ]
    )
    facts = {
        "arm": str(answer["arm"]),
        "mode": str(answer["mode"]),
        "model": str(answer["model"]),
        "operator": str(answer["operator"]),
        "learnt up to": f"{figure(certificate['band_hz'])} Hz",
    }
    sections = [
        section("Learning curve, certificate, torques before and after", picture(Path(answer["plot"]))),
        section("Velocity error of each trial", _trials(answer)),
        *([section("Taught for other motions", _taught(taught))] if (taught := answer.get("taught")) else []),
        section(
            "Certificate",
            element("p", f"{certificate['verdict']}: {certificate['reason']}"),
            *(element("p", sentence) for sentence in answer.get("held_joints", [])),
            folded("Gain of an error from trial to trial", _gain(certificate)),
        ),
        section(
            "What this rests on",
            element("ul", *(element("li", element("span", path, of="path")) for path in answer["recordings"])),
        ),
    ]
    return page("Étude · practice", f"{answer['motion']}, practised", lead, facts, sections)


def controllers_page(answer: Answer) -> str:
    """The page as HTML, from the JSON answer of `compare-controllers`."""
    joints = list(answer["controllers"][0]["peak_deg"])
    rows = [
        [
            row["family"],
            row["controller"] + ("" if row["played"] else " (not played: its lag)"),
            f"{row['rate_hz']:.0f}",
            *(figure(row["peak_deg"][j]) for j in joints),
        ]
        for row in answer["controllers"]
    ]
    numbers = tuple(range(2, 3 + len(joints)))
    best = min(answer["controllers"], key=lambda row: max(row["peak_deg"].values()))
    lead = f"Least error: {best['family']}, {best['controller']}, at most {figure(max(best['peak_deg'].values()))}°."
    sections = [
        section("Tracking errors over the motion", picture(Path(answer["plot"]))),
        section("Peak errors", table(["servo", "controller", "Hz", *(f"{j} [°]" for j in joints)], rows, numbers)),
        section("Findings", element("ul", *(element("li", finding) for finding in answer["findings"]))),
    ]
    facts = {"arm": str(answer["arm"]), "model": str(answer["model"])}
    return page("Étude · controllers", f"{answer['motion']} under each controller", lead, facts, sections)


def _times(trial: Answer, floor: Mapping[str, float]) -> float:
    errors: Mapping[str, float] = trial["velocity_error_rms"]
    return max(error / floor[joint] for joint, error in errors.items())


def _taught(effects: Sequence[Answer]) -> Html:
    return element("ul", *(element("li", taught_text(dict(one))) for one in effects))


def _trials(answer: Answer) -> Html:
    floor = answer["repeatability"]
    rows = []
    for k, trial in enumerate(answer["trials"]):
        name = f"model, {answer['replays']} replays" if k == 0 else f"trial {k}"
        errors = (figure(trial["velocity_error_rms"][joint]) for joint in floor)
        rows.append([name, *errors, f"{_times(trial, floor):.2f}", "; ".join(trial["findings"])])
    rows.append(["repeatability", *(figure(x) for x in floor.values()), "1.00", ""])
    headings = ["", *(f"{joint} [rad/s]" for joint in floor), "× repeatability", "findings"]
    return table(headings, rows, numbers=tuple(range(1, len(floor) + 2)))


def _gain(certificate: Answer) -> Html:
    rows = [[figure(line["frequency"]), figure(line["spectral_radius"])] for line in certificate["gain"]]
    return table(["frequency [Hz]", "spectral radius"], rows, numbers=(0, 1))
