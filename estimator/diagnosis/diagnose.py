"""The whole way from recordings and the given model to causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import base_parameters
from estimator.diagnosis.design import Design, Hypothesis, make_design
from estimator.diagnosis.grams import sum_up
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.repetition import lay, playings, repeated_noise
from estimator.diagnosis.search import Cause, Search
from estimator.diagnosis.stretches import Grid, Stretch, channels_of, rows_band, stretches
from estimator.diagnosis.tolerance import base_precision
from estimator.effects import Scales, catalogue
from estimator.repeats import find_repeats
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """All that a diagnosis rests on."""

    design: Design
    pieces: tuple[Stretch, ...]
    grid: Grid
    noise: Noise
    search: Search
    causes: tuple[Cause, ...]


def gather(body: RigidBody, trajectories: Sequence[Trajectory], tolerance: float) -> Evidence:
    grid = Grid(rows_band(trajectories), channels_of(body, trajectories))
    pieces = [piece for k, trajectory in enumerate(trajectories) for piece in stretches(body, grid, k, trajectory)]
    if not pieces:
        raise InputError(
            trajectories[0].name,
            "has no gapless stretch long enough to judge",
            "record at least some seconds of motion",
        )
    groups = find_repeats(trajectories)
    rows = playings(groups, grid, lay(pieces, [piece.residual for piece in pieces]))
    noise = repeated_noise(rows)
    if noise is None:
        raise InputError("recordings", "no motion recurs", "play a motion twice")
    base = base_parameters(body)
    hypotheses = [Hypothesis(e, place) for e in catalogue().values() for place in e.places(body)]
    scales = Scales.of([piece.signals for piece in pieces], grid.band)
    precision = base_precision(body, base, tolerance)
    design = make_design(body, base, grid.channels, hypotheses, scales, precision)
    decimations = [grid.decimation(piece.signals.period) for piece in pieces]
    blocks = sum_up(design, pieces, decimations, noise)
    search = Search(design, blocks, list(range(len(blocks))))
    return Evidence(design, tuple(pieces), grid, noise, search, tuple(search.run()))
