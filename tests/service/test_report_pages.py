"""Report pages: they say what the answer says, need nothing from elsewhere, and are refused without an answer."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from config import InputError
from estimator.diagnosis.telling.traces import Signature, Traces
from service.cli.entry import run
from service.diagnosis.keeping import ANSWER, PAGE
from service.diagnosis.traces_file import TRACES, load_traces, save_traces
from service.reports.diagnosis_figures import alternatives_figure, binned, residual_figure, signature_figure
from service.reports.diagnosis_page import diagnosis_page
from service.reports.page import Html, element, page, table
from service.reports.pages import page_of_file

VOID = {"meta", "img", "link", "br", "use", "path", "image", "rect"}


class Outline(HTMLParser):
    """Open elements, text, and whatever a page would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag != "script"
        if tag not in VOID:
            self.open.append(tag)
        self.loads += [
            v for k, v in attrs if v and k in ("src", "href", "xlink:href") and not v.startswith(("#", "data:"))
        ]

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


@pytest.fixture
def traces() -> Traces:
    rng = np.random.default_rng(5)
    t = np.arange(600) / 20.0
    dq = np.sin(t)
    law = 1.5 * np.tanh(dq / 0.05)
    noise = 0.1 * rng.standard_normal((600, 2))
    before = noise + np.stack([np.zeros(600), law], axis=1)
    signature = Signature("speed of elbow", "rad/s", "torque of elbow", "N·m", dq, law + noise[:, 1], law, dq, law)
    return Traces(0, t, before, noise, np.array([0.1, 0.1]), (signature,))


@pytest.fixture
def answer() -> dict[str, Any]:
    finding = {
        "effect": "coulomb_friction",
        "joint": "elbow",
        "channel": None,
        "status": "ambiguous",
        "sentence": "joint elbow has coulomb friction: level 1.50 ± 0.02 N·m",
        "parameters": {"level": {"value": 1.5031, "standard_error": 0.0213, "unit": "N·m"}},
        "share_of_explainable": 0.9,
        "evidence": {"log_likelihood_gain": 812.0, "false_alarm_probability": 1e-9},
        "alternatives": [{"effect": "presliding", "joint": "elbow", "channel": None, "log_likelihood_gap": 1.2}],
        "next_experiment": {"sentence": "move joint elbow in micro-reversals", "motion": None, "predicted_gap": None},
    }
    return {
        "arm": "two <links>",
        "verdict": "ambiguous",
        "summary": "nothing beyond the noise",
        "recordings": ["a.csv", "b.csv"],
        "hold_out": ["later.csv"],
        "findings": [finding],
        "unexplained": {"shoulder": {"share": 0.42, "signature": "lives at 3.2 per turn"}},
        "torque_residual": {
            "shoulder": {"before_rms": 0.1, "after_rms": 0.1, "noise_rms": 0.1, "unit": "N·m"},
            "elbow": {"before_rms": 1.5, "after_rms": 0.1, "noise_rms": 0.1, "unit": "N·m"},
        },
        "gain": {
            "held_out_torque": {"before_rms": 1.06, "after_rms": 0.11, "share_of_explainable": 0.97, "unit": "N·m"},
            "simulation": None,
        },
        "smallest_detectable": {"viscous_friction": {"shoulder": 0.031, "elbow": 0.027}, "base_tilt": {"arm": 0.002}},
        "smallest_detectable_units": {"viscous_friction": "N·m·s/rad", "base_tilt": "rad"},
        "model": None,
        "band_hz": 10.0,
        "experiments": [],
        "notes": ["noise from 6 playings of 3 repeated motions"],
        "report": None,
    }


def test_the_page_says_what_was_found_how_sure_and_what_to_do_next(answer: dict[str, Any], traces: Traces) -> None:
    outline = Outline(diagnosis_page(answer, traces))
    words = " ".join(" ".join(outline.words).split())
    assert not outline.open
    assert not outline.loads
    for said in (
        "Joint elbow has coulomb friction: level 1.50 ± 0.02 N·m",
        "1.503 0.021 N·m",
        "812",
        "move joint elbow in micro-reversals",
        "42 % of what can be explained there has no name",
        "falls from 1.06 to 0.11 N·m rms",
        "97 % of what any model could explain",
        "viscous friction 0.031 0.027 N·m·s/rad",
        "later.csv, which was not learnt from",
        "noise from 6 playings".capitalize(),
    ):
        assert said in words, said


def test_the_page_says_what_was_played_and_what_it_decided(answer: dict[str, Any], traces: Traces) -> None:
    assert "What was played" not in diagnosis_page(answer, traces)
    rivals = [
        {"effect": "coulomb_friction", "joint": "elbow", "other": None, "channel": None},
        {"effect": "transport_delay", "joint": None, "other": None, "channel": "velocity"},
    ]
    played = [
        {"motion": f"/there/experiment-{k}.toml", "between": rivals, "predicted_gap": 41.0, "gap": gap}
        for k, gap in enumerate((38.2, 1.1, None), 1)
    ]
    played.append({"motion": None, "drives_off_s": 30.0, "between": rivals, "predicted_gap": 41.0, "gap": 52.3})
    answer["experiments"] = played
    answer["findings"][0]["next_experiment"] |= {"motion": "/there/experiment-4.toml", "predicted_gap": 12.7}
    words = " ".join(" ".join(Outline(diagnosis_page(answer, traces)).words).split())
    for said in (
        "coulomb friction of elbow · transport delay of velocity channel",
        "experiment-1",
        "41 38.2 decided",
        "41 1.1 still open",
        "41 – none of them is left",
        "drives off coulomb friction of elbow · transport delay of velocity channel 41 52.3 decided",
        "etude run /there/experiment-4.toml",
        "apart by 13 nats",
    ):
        assert said in words, said


def test_many_causes_stand_in_a_table_first_each_with_a_way_to_its_card(answer: dict[str, Any], traces: Traces) -> None:
    assert "At a glance" not in diagnosis_page(answer, traces)
    (found,) = answer["findings"]
    names = ["coulomb_friction", "viscous_friction", "presliding"]
    answer["findings"] = [found | {"effect": e, "joint": j} for j in ("elbow", "wrist") for e in names]
    page = diagnosis_page(answer, None)
    words = " ".join(" ".join(Outline(page).words).split())
    row = "level 1.503 ± 0.021 N·m ambiguous 90 %"
    table = f"elbow coulomb friction {row} viscous friction {row} presliding {row} wrist coulomb friction {row}"
    assert table in words
    assert words.index(table) < words.index("What it gains") < words.index("Cause by cause") < words.index("812")
    assert [page.count(f'href="#cause-{k}"') for k in range(1, 8)] == [1] * 6 + [0]
    assert [page.count(f'id="cause-{k}"') for k in range(1, 8)] == [1] * 6 + [0]


def test_a_sliding_joint_s_residual_is_a_force(answer: dict[str, Any], traces: Traces) -> None:
    answer["torque_residual"]["elbow"]["unit"] = "N"
    answer["gain"]["held_out_torque"]["unit"] = "N·m, N"
    outline = Outline(diagnosis_page(answer, traces))
    assert "N·m, N rms" in " ".join(" ".join(outline.words).split())
    assert "N" in outline.words
    drawn = residual_figure(traces, {"shoulder": "N·m", "elbow": "N"})
    assert "[N]" in drawn
    assert "[N·m]" in drawn


def test_names_cannot_break_the_page(answer: dict[str, Any], traces: Traces) -> None:
    text = diagnosis_page(answer, traces)
    assert "two &lt;links&gt;" in text
    assert "<links>" not in text


@pytest.mark.parametrize("verdict", ["clean", "unknown"])
def test_pages_without_findings(answer: dict[str, Any], traces: Traces, verdict: str) -> None:
    bare = {
        **answer,
        "findings": [],
        "verdict": verdict,
        "unexplained": answer["unexplained"] if verdict == "unknown" else {},
    }
    outline = Outline(diagnosis_page(bare, replace(traces, signatures=())))
    words = " ".join(outline.words)
    assert not outline.open
    assert ("has no name" in words) is (verdict == "unknown")
    assert ("Nothing beyond the noise. What would have been seen" in words) is (verdict == "clean")
    assert "0.031" in words


def test_figures_are_svg_that_stays_the_same_and_whose_parts_have_names_of_their_own(traces: Traces) -> None:
    (signature,) = traces.signatures
    figures = [
        signature_figure(0, signature),
        signature_figure(1, signature),
        alternatives_figure(0, "cogging · elbow", [{"effect": "x", "joint": None, "log_likelihood_gap": 2000.0}]),
        residual_figure(traces, {"shoulder": "N·m", "elbow": "N·m"}),
    ]
    for figure in figures:
        assert ElementTree.fromstring(figure).get("role") == "img"
    assert signature_figure(0, signature) == figures[0]
    used = [set(re.findall(r'clipPath id="(\w+)"', figure)) for figure in figures]
    assert used[0]
    assert not used[0] & used[1]


def test_the_mean_of_a_cloud_follows_its_law() -> None:
    rng = np.random.default_rng(2)
    x = rng.uniform(-1.0, 1.0, 20_000)
    centres, mean = binned(x, 3.0 * x + rng.standard_normal(x.size))
    assert len(centres) == 60
    np.testing.assert_allclose(mean, 3.0 * centres, atol=0.25)


def test_traces_come_back_as_they_were_kept(traces: Traces, tmp_path: Path) -> None:
    save_traces(tmp_path / TRACES, traces)
    again = load_traces(tmp_path / TRACES)
    np.testing.assert_allclose(again.before, traces.before, rtol=1e-6)
    np.testing.assert_allclose(again.signatures[0].law, traces.signatures[0].law, rtol=1e-6)
    assert again.signatures[0].quantity == "speed of elbow"


def test_what_is_no_traces_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / TRACES).write_bytes(b"not an archive")
    with pytest.raises(InputError, match="holds no traces"):
        load_traces(tmp_path / TRACES)


def test_report_makes_the_page_of_a_kept_answer_again(
    answer: dict[str, Any], traces: Traces, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / ANSWER).write_text(json.dumps(answer))
    save_traces(tmp_path / TRACES, traces)
    assert run(["report", str(tmp_path)]) == 0
    assert str(tmp_path / PAGE) in capsys.readouterr().out
    with_pictures = (tmp_path / PAGE).read_text()
    assert with_pictures == diagnosis_page(answer, load_traces(tmp_path / TRACES))
    (tmp_path / TRACES).unlink()
    page_of_file(tmp_path / ANSWER)
    assert (tmp_path / PAGE).read_text().count("<svg") < with_pictures.count("<svg")


@pytest.mark.parametrize(
    ("content", "problem"), [("{}", "is no answer that has a page"), ("{", "is not JSON"), ("[]", "is no answer")]
)
def test_what_is_no_answer_is_refused(content: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "answer.json"
    path.write_text(content)
    with pytest.raises(InputError, match=problem):
        page_of_file(path)


def test_an_answer_of_another_version_is_refused_in_a_sentence(
    answer: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del answer["gain"]["held_out_torque"]["unit"]
    (tmp_path / ANSWER).write_text(json.dumps(answer))
    assert run(["report", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "as this version does not write it" in told
    assert "ask again with the recordings" in told
    assert not (tmp_path / PAGE).exists()


def test_plain_text_is_escaped_and_html_is_not() -> None:
    assert element("p", "a < b", Html("<b>c</b>")) == "<p>a &lt; b<b>c</b></p>"
    assert '<td class="number">1</td>' in table(["name", "value"], [["x", "1"]], numbers=(1,))
    whole = page("k", "t & u", "lead", {"fact": "1", "empty": ""}, [])
    assert "t &amp; u" in whole
    assert "empty" not in whole


def links_answer(plot: Path) -> dict[str, Any]:
    residual = {"elbow": {"rms": 0.3, "relative": 0.012, "noise_rms": 0.2, "unit": "N·m"}}
    return {
        "arm": "dda",
        "status": "identified",
        "samples": 600,
        "estimator": "weighted",
        "band": 10.0,
        "condition_number": 23.0,
        "identifiability": {"alone": ["m1"], "combined": ["m2 + m3"], "not": ["Ixx1"]},
        "base_parameters": [{"name": "Izz1 + Ixx2", "value": 12.78, "standard_error": 0.0039, "unit": "kg·m²"}],
        "effects": [
            {"effect": "coulomb_friction", "joint": "elbow", "parameter": "level", "value": 0.14,
             "standard_error": 0.005, "unit": "N·m"}
        ],
        "torque_residual": residual,
        "relative_error": 0.7,
        "hold_out": residual,
        "hold_out_relative_error": 0.9,
        "notes": ["joints that were not recorded are held still"],
        "warnings": [],
        "model": "links.toml",
        "urdf": None,
        "plot": str(plot),
    }  # fmt: skip


def load_answer() -> dict[str, Any]:
    def known(value: Any, error: Any, unit: str) -> dict[str, Any]:
        return {"value": value, "standard_error": error, "unit": unit}

    return {
        "arm": "puma600",
        "frame": "tool",
        "status": "identified",
        "method": "wrench",
        "samples": 400,
        "band_hz": 12.0,
        "mass": known(1.106, 0.003, "kg"),
        "centre": known([0.001, 0.002, 0.05], [0.0002] * 3, "m"),
        "inertia": known([0.0244, 0.0, 0.0, 0.0007, 0.0, 0.0242], [1e-4] * 6, "kg·m²"),
        "principal_moments": known([0.0007, 0.0242, 0.0244], [1e-4] * 3, "kg·m²"),
        "rigid": {"verdict": "rigid", "p_value": 0.4, "detectable_share": 0.01, "noise_from": "repeats"},
        "recognition": None,
        "verification": {"verdict": "accepted", "expected": "block", "mass_tolerance": 0.05,
                         "centre_tolerance": 0.003, "false_acceptance": 0.001, "false_rejection": 0.002},
        "wrench_delay": {"value": 0.004, "standard_error": 1e-4},
        "wrench_residual": {"fx": {"rms": 0.2, "relative": 0.02}},
        "torque_residual": None,
        "hold_out": None,
        "plot": None,
        "load_file": "block.toml",
    }  # fmt: skip


def test_the_page_of_links_takes_its_plot_in(tmp_path: Path) -> None:
    plot = tmp_path / "torques.png"
    plot.write_bytes(b"\x89PNG")
    (tmp_path / "links.json").write_text(json.dumps(links_answer(plot)))
    text = page_of_file(tmp_path / "links.json").read_text()
    words = " ".join(Outline(text).words)
    assert "data:image/png;base64," in text
    assert "predicts the joint torques to 0.9 % on motion that was not learnt from" in words
    for said in ("Izz1 + Ixx2", "12.78", "coulomb friction", "1.20 %", "held still"):
        assert said in words, said


def test_the_page_of_a_load_says_what_it_weighs_and_whether_it_is_the_expected_one(tmp_path: Path) -> None:
    (tmp_path / "load.json").write_text(json.dumps(load_answer()))
    outline = Outline(page_of_file(tmp_path / "load.json").read_text())
    words = " ".join(" ".join(outline.words).split())
    assert not outline.open
    for said in ("weighs 1.106 ± 0.003 kg", "(0.001, 0.002, 0.05) m in tool", "accepted: block", "4.00 ± 0.1 ms late"):
        assert said in words, said
