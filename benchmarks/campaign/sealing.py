"""A staged scenario as files: what the finder may read in one folder, the answer in a sealed envelope in another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.campaign.playing import DRIVES_OFF, Run
from benchmarks.campaign.scenario import Staged, Truth

QUESTION, ANSWER, HELD_OUT = "question", "answer", "held-out"


@dataclass(frozen=True)
class Question:
    """What the finder is given: one folder with a URDF and recordings."""

    folder: Path

    @property
    def urdf(self) -> Path:
        return self.folder / "arm.urdf"

    @property
    def learnt(self) -> tuple[Path, ...]:
        return tuple(p for p in self._recordings() if not p.name.startswith((HELD_OUT, DRIVES_OFF)))

    @property
    def held_out(self) -> tuple[Path, ...]:
        return tuple(p for p in self._recordings() if p.name.startswith(HELD_OUT))

    @property
    def drives_off(self) -> tuple[Path, ...]:
        return tuple(p for p in self._recordings() if p.name.startswith(DRIVES_OFF))

    def _recordings(self) -> list[Path]:
        return sorted(p for p in self.folder.iterdir() if p.suffix in (".csv", ".mcap"))


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
        return Envelope(path, _digest(text))

    def open(self) -> Truth:
        """Read the answer. Raises ValueError where it was changed since."""
        text = self.path.read_text(encoding="utf-8")
        if _digest(text) != self.digest:
            raise ValueError(f"{self.path}: the envelope was changed after it was closed")
        return Truth.from_json(json.loads(text))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def seal(staged: Staged, joints: Sequence[str], tachometers: bool, folder: Path) -> tuple[Question, Envelope]:
    """Write recordings beside the staged URDF, in ``folder``/question, and the answer into ``folder``/answer.

    Without tachometers the velocity is left out: a drive's own differences of its counts hold nothing new.
    """
    (folder / ANSWER).mkdir()
    for number, run in enumerate(staged.runs, 1):
        kind = next((kind for kind in (HELD_OUT, DRIVES_OFF) if run.motion.startswith(kind)), "run")
        write_run(run, joints, tachometers, folder / QUESTION / f"{kind}-{number:02d}.csv")
    envelope = Envelope.close(staged.truth, folder / ANSWER / "truth.json")
    return Question(folder / QUESTION), envelope


def found_sealed(folder: Path) -> tuple[Question, Envelope] | None:
    """A scenario that was sealed into ``folder`` before, or None."""
    path = folder / ANSWER / "truth.json"
    if not path.is_file():
        return None
    return Question(folder / QUESTION), Envelope(path, _digest(path.read_text(encoding="utf-8")))


def write_run(run: Run, joints: Sequence[str], with_velocity: bool, path: Path) -> None:
    """One run as CSV."""
    quantities = {"q": run.q, **({"dq": run.dq} if with_velocity else {}), "tau": run.tau}
    header = ",".join(["t", *(f"{name}_{joint}" for name in quantities for joint in joints)])
    np.savetxt(
        path, np.column_stack([run.t, *quantities.values()]), fmt="%.9g", delimiter=",", header=header, comments=""
    )
