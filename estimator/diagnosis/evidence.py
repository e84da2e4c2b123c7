"""From recordings and the given model to all that a diagnosis rests on: the design, its Gram matrices, their noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import base_parameters
from estimator.diagnosis.design import Design, Hypothesis, make_design, stretch_rows
from estimator.diagnosis.grams import Block, sum_up
from estimator.diagnosis.noise import Noise, assumed_noise
from estimator.diagnosis.repetition import lay, playings, repeated_noise
from estimator.diagnosis.stretches import Grid, Stretch, channels_of, rows_band, stretches
from estimator.diagnosis.tolerance import base_precision
from estimator.effects import Scales, catalogue
from estimator.repeats import RepeatGroup, find_repeats
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_RECORDINGS_A_FOLD = 4
"""From so many recordings on, whole recordings are left out; else blocks of neighbouring rows."""


@dataclass(frozen=True)
class Evidence:
    """Recordings as Gram matrices of all hypotheses."""

    design: Design
    grid: Grid
    pieces: tuple[Stretch, ...]
    decimations: tuple[int, ...]
    repeats: tuple[RepeatGroup, ...]
    noise: Noise
    blocks: tuple[Block, ...]
    folds: tuple[int, ...]
    """With which fold each block is left out."""


def gather(body: RigidBody, trajectories: Sequence[Trajectory], tolerance: float) -> Evidence:
    """One pass over the recordings.

    Raises InputError when no recording has a gapless stretch that is long enough.
    """
    grid = Grid(rows_band(trajectories), channels_of(body, trajectories))
    pieces = cut(body, grid, trajectories)
    decimations = [grid.decimation(piece.signals.period) for piece in pieces]
    repeats = find_repeats(trajectories)
    base = base_parameters(body)
    hypotheses = [Hypothesis(effect, place) for effect in catalogue().values() for place in effect.places(body)]
    scales = Scales.of([piece.signals for piece in pieces], grid.band)
    precision = base_precision(body, base, tolerance)
    design = make_design(body, base, grid.channels, hypotheses, scales, precision)
    noise = repeated_noise(playings(repeats, grid, lay(pieces, [piece.residual for piece in pieces])))
    if noise is None:
        plain = Noise.none(len(grid.channels))
        noise = assumed_noise(
            [stretch_rows(design, piece, d, plain) for piece, d in zip(pieces, decimations, strict=True)]
        )
    blocks = sum_up(design, pieces, decimations, noise)
    if not blocks:
        raise InputError(
            trajectories[0].name, "is too short to judge a model by", "record at least some seconds of motion"
        )
    recordings = [block.recording for block in blocks]
    whole = len(set(recordings)) >= _RECORDINGS_A_FOLD
    folds = recordings if whole else list(range(len(blocks)))
    return Evidence(design, grid, tuple(pieces), tuple(decimations), tuple(repeats), noise, tuple(blocks), tuple(folds))


def cut(body: RigidBody, grid: Grid, trajectories: Sequence[Trajectory]) -> list[Stretch]:
    """Gapless stretches of all recordings. Raises InputError when there is none that is long enough."""
    pieces = [piece for k, trajectory in enumerate(trajectories) for piece in stretches(body, grid, k, trajectory)]
    if not pieces:
        raise InputError(
            trajectories[0].name,
            "has no gapless stretch long enough to judge",
            "record at least some seconds of motion",
        )
    return pieces
