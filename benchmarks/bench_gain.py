"""What the model that a diagnosis finds gains on the stand-in direct drive arm, through the wire, by the house's own
commands: how far the arm is from a motion under feedforward, and how many trials practice needs to repeatability.

The motion is Table 6.1's, which the diagnosis has not seen; the given model is the arm's URDF.
"""

from __future__ import annotations

from typing import Any

from benchmarks.bench_practice import MOTION, ratios, up
from benchmarks.figure import Figure

SEED = 0
TRIALS = 6
NEAR = 1.1
"""Times the repeatability, in the worst joint: reached."""


def measure() -> list[Figure]:
    with up(SEED) as daemon:
        found = daemon.call("diagnose", {"budget": 2, "track": MOTION})
        practised = {
            when: daemon.call("practise", {"motion": MOTION, "model": model, "trials": TRIALS})
            for when, model in (("given", None), ("found", found["model"]))
        }
    gained = found["gain"]
    torque = gained["held_out_torque"]
    told = [_pair("held_out_torque", torque["before_rms"], torque["after_rms"], torque["unit"])]
    for name in ("simulation", "tracking"):
        before, after = (gained[name][f"position_{when}_rms"] for when in ("before", "after"))
        told.append(_pair(name, before, after, gained[name]["unit"]))
    first = {when: ratios(answer)[0] for when, answer in practised.items()}
    trials = {when: _trials(answer) for when, answer in practised.items()}
    told.append(_pair("first_error", first["given"], first["found"], "× repeatability"))
    told.append(_pair("trials_to_repeatability", trials["given"], trials["found"], "trials"))
    return told


def _pair(name: str, before: float, after: float, unit: str) -> Figure:
    return Figure(f"gain_{name}", float(after), unit, "with the given model", float(before))


def _trials(practised: dict[str, Any]) -> float:
    """The first trial that is near repeatability in all joints; infinite where none is."""
    return float(next((k for k, ratio in enumerate(ratios(practised)) if ratio <= NEAR), float("inf")))
