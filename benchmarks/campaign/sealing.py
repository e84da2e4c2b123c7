"""A staged scenario as files: what the finder may read in one folder, the answer in a sealed envelope in another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.campaign.playing import Run
from benchmarks.campaign.scenario import Staged, Truth


@dataclass(frozen=True)
class Question:
    """What the finder is given."""

    urdf: Path
    learnt: tuple[Path, ...]
    held_out: tuple[Path, ...]

    @property
    def seconds(self) -> float:
        """Of motion to learn from, by the first column of the files."""
        return sum(_last_time(path) - _first_time(path) for path in self.learnt)


@dataclass(frozen=True)
class Envelope:
    """The answer, closed: it is what it was when the finder began."""

    path: Path
    digest: str

    @staticmethod
    def close(truth: Truth, path: Path) -> Envelope:
        """Write the answer to ``path``."""
        text = json.dumps(truth.as_json(), indent=1, sort_keys=True, allow_nan=False)
        path.write_text(text, encoding="utf-8")
        return Envelope(path, hashlib.sha256(text.encode()).hexdigest())

    def open(self) -> Truth:
        """Read the answer. Raises ValueError where it was changed since."""
        text = self.path.read_text(encoding="utf-8")
        if hashlib.sha256(text.encode()).hexdigest() != self.digest:
            raise ValueError(f"{self.path}: the envelope was changed after it was closed")
        return Truth.from_json(json.loads(text))


def seal(staged: Staged, joints: Sequence[str], tachometers: bool, folder: Path) -> tuple[Question, Envelope]:
    """Write recordings into ``folder``/question and the answer into ``folder``/answer.

    Without tachometers the velocity is left out: a drive's own differences of its counts hold nothing new.
    """
    question, answer = folder / "question", folder / "answer"
    question.mkdir(exist_ok=True)
    answer.mkdir()
    learnt: list[Path] = []
    held_out: list[Path] = []
    for number, run in enumerate(staged.runs, 1):
        kept = held_out if run.motion.startswith("held-out") else learnt
        path = question / f"{'held-out' if kept is held_out else 'run'}-{number:02d}.csv"
        write_run(run, joints, tachometers, path)
        kept.append(path)
    envelope = Envelope.close(staged.truth, answer / "truth.json")
    return Question(staged.urdf, tuple(learnt), tuple(held_out)), envelope


def write_run(run: Run, joints: Sequence[str], with_velocity: bool, path: Path) -> None:
    """One run as CSV."""
    quantities = {"q": run.q, **({"dq": run.dq} if with_velocity else {}), "tau": run.tau}
    header = ",".join(["t", *(f"{name}_{joint}" for name in quantities for joint in joints)])
    np.savetxt(
        path, np.column_stack([run.t, *quantities.values()]), fmt="%.9g", delimiter=",", header=header, comments=""
    )


def _first_time(path: Path) -> float:
    with path.open(encoding="utf-8") as lines:
        next(lines)
        return float(next(lines).split(",", 1)[0])


def _last_time(path: Path) -> float:
    with path.open(encoding="utf-8") as lines:
        return float(list(lines)[-1].split(",", 1)[0])
