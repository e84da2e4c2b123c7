"""What a practice leaves in its session's directory: which recording is which, and the feedforward of each play.

Nothing else is kept between trials: a session that ended early is resumed by learning again from its recordings.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from config import InputError
from config.text_file import read_text
from service.sessions.store import write_atomically

Array = NDArray[np.float64]
FILE = "practice.json"
PlayKind = Literal["replay", "trial"]


class Play(BaseModel):
    """One motion that was played to its end."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: PlayKind
    recording: str
    """Path."""
    feedforward: str
    """File in the session's directory."""


class PracticeRecord(BaseModel):
    """``practice.json``, replaced after each play."""

    model_config = ConfigDict(extra="forbid")

    plays: list[Play] = []

    def add(self, play: Play, directory: Path) -> None:
        self.plays.append(play)
        write_atomically(directory / FILE, self.model_dump_json(indent=1) + "\n")

    def of(self, kind: PlayKind) -> list[Path]:
        return [Path(play.recording) for play in self.plays if play.kind == kind]


def read_record(directory: Path) -> PracticeRecord:
    """Raises InputError when the session has practised nothing that can be resumed."""
    path = directory / FILE
    try:
        return PracticeRecord.model_validate(json.loads(path.read_text()))
    except FileNotFoundError:
        raise InputError(f"session {directory.name}", "has played nothing to its end", "practise anew") from None
    except (OSError, ValueError, ValidationError) as error:
        raise InputError(str(path), f"cannot be read ({error})", "practise anew") from None


def write_feedforward(path: Path, torque: Array, period: float, joints: tuple[str, ...]) -> None:
    """Torques (samples × joints, N·m) as CSV: ``t`` and ``tau_<joint>``, as they are sent."""
    lines = [",".join(["t", *(f"tau_{joint}" for joint in joints)])]
    lines += [",".join([f"{k * period:.6f}", *(repr(float(x)) for x in row)]) for k, row in enumerate(torque)]
    write_atomically(path, "\n".join(lines) + "\n")


def read_feedforward(path: Path, joints: tuple[str, ...], samples: int) -> Array:
    """(samples, joints) N·m. Raises InputError naming line and column, or when it is of another motion or arm."""
    try:
        rows: list[list[str]] = list(csv.reader(read_text(path).splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})", "give a feedforward that practice wrote") from None
    header = ["t", *(f"tau_{joint}" for joint in joints)]
    if not rows or rows[0] != header:
        raise InputError(f"{path}, line 1", f"is not {','.join(header)}", "give a feedforward of this arm")
    if len(rows) - 1 != samples:
        raise InputError(
            str(path), f"has {len(rows) - 1} samples and the motion {samples}", "give the one learnt on this motion"
        )
    table: list[Any] = []
    for number, row in enumerate(rows[1:], 2):
        try:
            values = [float(entry) for entry in row]
        except ValueError:
            values = []
        if len(values) != len(header) or not np.isfinite(values).all():
            raise InputError(f"{path}, line {number}", "is not a row of finite numbers", "mend that line")
        table.append(values[1:])
    return np.array(table)
