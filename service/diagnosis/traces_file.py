"""The traces of a diagnosis as a file beside its answer: what its page is drawn from."""

from __future__ import annotations

import json
from dataclasses import astuple
from pathlib import Path

import numpy as np

from config import InputError
from estimator.diagnosis.telling.traces import Signature, Traces

TRACES = "traces.npz"
_ARRAYS = ("t", "before", "after", "noise")


def save_traces(path: Path, traces: Traces) -> None:
    """Write as .npz. Raises InputError when that cannot be done."""
    arrays = {name: getattr(traces, name).astype(np.float32) for name in _ARRAYS}
    words = []
    for number, signature in enumerate(traces.signatures):
        *said, x, measured, law, curve_x, curve = astuple(signature)
        words.append(said)
        arrays[f"signature_{number}"] = np.array([x, measured, law], dtype=np.float32)
        arrays[f"curve_{number}"] = np.array([curve_x, curve], dtype=np.float32)
    labels = json.dumps({"recording": traces.recording, "signatures": words})
    try:
        with path.open("wb") as file:
            np.savez_compressed(file, labels=np.array(labels), **arrays)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror})", "choose another --out") from None


def load_traces(path: Path) -> Traces:
    """Read back, in single precision. Raises InputError when it is no such file."""
    try:
        with np.load(path, allow_pickle=False) as kept:
            labels = json.loads(str(kept["labels"]))
            t, before, after, noise = (kept[name].astype(np.float64) for name in _ARRAYS)
            signatures = tuple(
                Signature(*words, *kept[f"signature_{number}"].astype(float), *kept[f"curve_{number}"].astype(float))
                for number, words in enumerate(labels["signatures"])
            )
            return Traces(labels["recording"], t, before, after, noise, signatures)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(str(path), f"holds no traces of a diagnosis ({error})", "diagnose again") from None
