"""What the pictures of a diagnosis are drawn from: arrays, kept beside its answer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signature:
    """One finding against the quantity that it depends on: what it leaves unexplained, and what its law says.

    Attributes:
        quantity, unit: of ``x``, for the axis.
        x, measured, law: (samples,) the quantity, the residual with every other finding taken off, the fitted law.
    """

    quantity: str
    unit: str
    x: Array
    measured: Array
    law: Array


@dataclass(frozen=True)
class Traces:
    """One recording's torque residual before and after, in the compared band, and the findings' signatures.

    Attributes:
        recording: its name.
        joints: by name; columns of ``before`` and ``after``.
        t: (samples,) s; NaN rows of ``before`` and ``after`` mark gaps.
        before, after: (samples × joints) N·m, of the given model and of the extended one.
        noise_rms: (joints,) N·m.
        signatures: by the finding's number in the answer.
    """

    recording: str
    joints: tuple[str, ...]
    t: Array
    before: Array
    after: Array
    noise_rms: Array
    signatures: Mapping[int, Signature]


def save_traces(path: Path, traces: Traces) -> None:
    """Write as .npz. Raises InputError when that cannot be done."""
    arrays = {name: getattr(traces, name).astype(np.float32) for name in ("before", "after", "noise_rms")}
    arrays |= {
        f"signature_{number}": np.array([s.x, s.measured, s.law], dtype=np.float32)
        for number, s in traces.signatures.items()
    }
    labels = {
        "recording": traces.recording,
        "joints": traces.joints,
        "signatures": {str(number): [s.quantity, s.unit] for number, s in traces.signatures.items()},
    }
    try:
        with path.open("wb") as file:
            np.savez_compressed(file, t=traces.t, labels=np.array(json.dumps(labels)), **arrays)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror})", "choose another --out") from None


def load_traces(path: Path) -> Traces:
    """Read back. Raises InputError when it is no such file."""
    try:
        with np.load(path) as kept:
            labels = json.loads(str(kept["labels"]))
            signatures = {
                int(number): Signature(quantity, unit, *kept[f"signature_{number}"].astype(np.float64))
                for number, (quantity, unit) in labels["signatures"].items()
            }
            t, before, after, noise_rms = (kept[n].astype(np.float64) for n in ("t", "before", "after", "noise_rms"))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(str(path), f"holds no traces of a diagnosis ({error})", "diagnose again") from None
    return Traces(labels["recording"], tuple(labels["joints"]), t, before, after, noise_rms, signatures)
