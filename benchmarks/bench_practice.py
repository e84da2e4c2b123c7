"""Practice of Table 6.1's motion on the stand-in direct drive arm, through the wire, by the house's own commands.

Each figure is the worst joint's velocity error over that joint's repeatability: what four operators reach in ten
practice movements, and how near to it motions begin that were never practised (Section 7.1). Draws
``docs/pictures/practice-operators.png``.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figure import Figure

ARM, MOTION, MODE = "dda", "dda-practice", "csp"
TRIALS = 10
PICTURE = Path(__file__).parent.parent / "docs" / "pictures" / "practice-operators.png"
OPERATORS: dict[str, dict[str, Any]] = {
    "trial filter": {},
    "thesis, 8 Hz": {"hand_picked_hz": 8.0},
    "decoupled, 8 Hz": {"operator": "decoupled", "hand_picked_hz": 8.0},
    "proportional, 8 Hz": {"operator": "proportional", "hand_picked_hz": 8.0},
}
START, END, DURATION = (0.5, 5.0, 4.0), (4.5, 1.0, -0.5), 1.5
NEARBY = {
    "ends moved by 0.1 rad": ((0.6, 4.9, 3.9), (4.6, 0.9, -0.4), DURATION),
    "20 % faster": (START, END, 0.8 * DURATION),
    "20 % slower": (START, END, 1.2 * DURATION),
}
REVERSED = (END, START, DURATION)


@contextmanager
def up() -> Iterator[Any]:
    """A client of the arm's daemon; stand-in and daemon in lockstep, in directories of their own."""
    from config import load_installation
    from service.daemon.client import DaemonClient
    from service.supervision import SupervisedProcess

    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="etude-")))
        os.environ["ETUDE_RUN"], os.environ["ETUDE_STATE"] = str(folder / "run"), str(folder / "state")
        config = str(load_installation(ARM).path)
        for name in ("virtual", "daemon"):
            process = SupervisedProcess([name, "--config", config, "--lockstep"])
            stack.callback(process.stop)
            process.wait_ready(90.0)
        yield stack.enter_context(DaemonClient(folder / "run", ARM))


def measure() -> list[Figure]:
    with up() as daemon:
        model = daemon.call("identify_links")["model"]
        answers: dict[str, dict[str, Any]] = {}
        for name, options in OPERATORS.items():
            # One that the certificate refuses ends this benchmark: on this arm all four are admitted.
            answers[name] = daemon.call("practise", {"motion": MOTION, "model": model, "trials": TRIALS, **options})
        figures = _learning(answers)
        best = answers["trial filter"]
        figures += _carried_over(daemon, best, model)
    return figures


def ratios(answer: dict[str, Any]) -> list[float]:
    """The worst joint's error over its repeatability, trial by trial; the first is the model's feedforward."""
    floor = answer["repeatability"]
    return [max(error / floor[joint] for joint, error in t["velocity_error_rms"].items()) for t in answer["trials"]]


def _learning(answers: dict[str, dict[str, Any]]) -> list[Figure]:
    from service.reports.practice_plot import plot_operators

    curves = {name: ratios(answer) for name, answer in answers.items()}
    plot_operators(PICTURE, f"{MOTION} on the stand-in arm, through the wire", curves)
    learnt = curves["trial filter"]
    figures = [
        Figure("practice_first", learnt[0], "× repeatability", "", None),
        Figure("practice_third", min(learnt[1:4]), "× repeatability", "the bound", 1.5),
        Figure("practice_last", learnt[-1], "× repeatability", "the bound", 1.1),
        Figure("practice_worst", max(learnt[1:]), "× repeatability", "the first trial", learnt[0]),
    ]
    for name, curve in curves.items():
        if name != "trial filter":
            figures.append(Figure(f"practice_last ({name})", curve[-1], "× repeatability", "trial filter", learnt[-1]))
    return figures


def _carried_over(daemon: Any, best: dict[str, Any], model: str) -> list[Figure]:
    from config import load_installation
    from driver.recording import read_recording
    from service.practice.planning import command_delay, practised_motion
    from service.practice.trials import trial_of

    installation = load_installation(ARM)
    floor = np.array(list(best["repeatability"].values()))
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (start, end, duration) in {**NEARBY, "reversed": REVERSED}.items():
            path = Path(folder) / "-".join(["near", *name.replace("%", "percent").split()])
            path = path.with_suffix(".toml")
            rows = f"way_points_rad = [{list(start)}, {list(end)}]\nduration_s = [{duration}]\n"
            path.write_text(f'kind = "polynomial"\n{rows}')
            reference = practised_motion(str(path), installation, MODE).reference
            found = []
            for source in (best["session"], model):
                played = daemon.call("run", {"motion": str(path), "feedforward": source})
                recording = read_recording(played["recording"])
                trial = trial_of(recording, reference, command_delay(MODE), name)
                found.append(float(np.max(trial.velocity_error_rms(reference) / floor)))
            figures.append(Figure(f"transfer ({name})", found[0], "× repeatability", "the model alone", found[1]))
    return figures
