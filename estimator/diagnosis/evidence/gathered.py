"""From recordings and the given model to all that a diagnosis rests on: the design, its Gram matrices, their noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import base_parameters
from estimator.diagnosis.evidence.design import Design, Hypothesis, make_design, stretch_rows
from estimator.diagnosis.evidence.drifts import drifts
from estimator.diagnosis.evidence.first_look import first_look, held, held_at, standing_throughout, with_turns
from estimator.diagnosis.evidence.folds import Folds, folds_of, parts_of
from estimator.diagnosis.evidence.grams import Block, Sheet, sheets
from estimator.diagnosis.evidence.maps import MAPS
from estimator.diagnosis.evidence.own_frictions import (
    spread_of,
    spreads_of,
    vigour_of,
    with_all_own,
    with_own_frictions,
)
from estimator.diagnosis.observed.assumed_noise import assumed_noise
from estimator.diagnosis.observed.drives_off import read_off
from estimator.diagnosis.observed.first_body import first_body, has_bodies
from estimator.diagnosis.observed.grains import repeated_share, repeated_white
from estimator.diagnosis.observed.noise import ORDER, Noise, autocovariance
from estimator.diagnosis.observed.repetition import lay, playings, repeated_noise
from estimator.diagnosis.observed.spending import Spent
from estimator.diagnosis.observed.stretches import Grid, Stretch, make_grid, mean_power, stretches, told_by
from estimator.diagnosis.observed.tolerance import given_precision
from estimator.effects import Effect, Lateness, Place, Scales, catalogue
from estimator.filtering import Decimator
from estimator.repeats import RepeatGroup, find_repeats
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

Ripple = Callable[[Array], Array]
_LEAST = 1e-9
"""N·m, rad/s: the error of a channel that never shows anything, as the speed of a joint that stands."""
EXACT = 5e-4
"""Of a channel's rms: time stamps, interpolation and the model's own arithmetic are no more exact than this."""


@dataclass(frozen=True)
class Evidence:
    """Recordings as Gram matrices of all hypotheses."""

    design: Design
    grid: Grid
    pieces: tuple[Stretch, ...]
    decimations: tuple[int, ...]
    repeats: tuple[RepeatGroup, ...]
    noise: Noise
    unseen: Array
    """(channels, ORDER + 1) autocovariance of errors that no playing shows."""
    blocks: tuple[Block | Sheet, ...]
    folds: Folds
    """What each block is left out with."""
    parts: int
    """Blocks of each recording, at least."""
    slow: Callable[[], Sequence[Stretch]]
    """The pieces with the slow part of their motion alone; made when they are first asked for."""
    recordings: int
    unseen_without: Callable[[Ripple], Array]
    """`unseen` of torques without a ripple (at angles (samples, n), N·m (samples, n)): what recurs above the band is
    taken for a white error, and ripples may be there."""
    tolerance: float | None = None
    """Of the links' parameters, as it was given; None where the model has no links that are known."""
    bend: Array | None = None
    """(10·n,) by which the links differ from the given ones of whose torques laws are made; None: they do not."""
    spent: tuple[Spent, ...] = ()
    """What motors give torque for beside the given model, for laws that go with all of it."""
    late: Lateness | None = None
    """By which torques answer late to the motion; laws are made of the motion so much earlier. None: they do
    not."""


def gather(
    body: RigidBody, trajectories: Sequence[Trajectory], tolerance: float, drives_off: Sequence[Trajectory] = ()
) -> Evidence:
    """One pass over the recordings; ``drives_off``: those in which the drives are off.

    Raises InputError when no recording has a gapless stretch that is long enough, when no joint moves, or when one was
    not made with the drives off.
    """
    reading = read_off(body, drives_off) if drives_off else None
    given, body = body, first_body(body, trajectories)
    grid = make_grid(body, trajectories)
    pieces = cut(body, grid, trajectories)
    if len(standing_throughout(pieces)) == body.n:
        raise InputError(
            ", ".join(dict.fromkeys(one.name for one in trajectories)),
            "no joint moves, and friction may hold each of them by any torque",
            "record motions of all joints, each played twice",
        )
    repeats = find_repeats(trajectories)
    base = base_parameters(body)
    hypotheses = [
        Hypothesis(law, place)
        for effect in catalogue().values()
        for law in effect.laws()
        for place in law.places(body)
        if _told_of(given, law, place)
    ]
    scales = Scales.of([piece.signals for piece in pieces], grid.band)
    # Torques are the first channels, one a joint.
    scales = replace(scales, tau=np.sqrt(mean_power(pieces)[: body.n]))
    hypotheses += [Hypothesis(drawn, place) for drawn in MAPS for place in drawn.told_of(body, scales)]
    rate = min(trajectory.rate for trajectory in trajectories)
    precision = given_precision(given, base, tolerance, grid.channels, rate)
    design = replace(make_design(body, base, grid.channels, hypotheses, scales, precision), reading=reading)
    rounded = _unseen(grid, pieces, repeated_share(grid.count, repeats))

    def unseen_without(ripple: Ripple) -> Array:
        again = _played_again(grid, trajectories, repeats, ripple)
        return np.column_stack([rounded[:, 0] + again, rounded[:, 1:]])

    slow, unseen = partial(cut, body, grid.slower(), trajectories), unseen_without(np.zeros_like)
    found = weighed(design, grid, pieces, slow, unseen, len(trajectories), repeats, unseen_without)
    return replace(found, tolerance=tolerance) if has_bodies(given) else found


def weighed(
    design: Design,
    grid: Grid,
    pieces: Sequence[Stretch],
    slow: Callable[[], Sequence[Stretch]],
    unseen: Array,
    recordings: int,
    repeats: Sequence[RepeatGroup],
    unseen_without: Callable[[Ripple], Array] | None = None,
) -> Evidence:
    """The rows of all pieces beside their noise: by ``repeats`` where there are any, else assumed; ``unseen``
    (channels, ORDER + 1), the autocovariance of errors that recur, is added to either. ``slow`` makes the pieces of
    `Evidence.slow`; ``unseen_without`` is that of `Evidence`, where ``unseen`` holds what recurs above the band.
    """
    exact = exactness(pieces)
    decimations = [grid.decimation(piece.signals.period) for piece in pieces]
    design = replace(design, vigour=vigour_of(design, pieces, recordings))
    rows = playings(repeats, grid, lay(pieces, [piece.residual for piece in pieces]))
    drifting = drifts(design, pieces, grid, repeats, rows, lambda own: repeated_noise(own, unseen, exact))
    noise = repeated_noise(rows := drifting.left, unseen, exact)
    restless = drifting.restless
    if noise is None:
        plain, wide = Noise.none(len(grid.channels)), with_all_own(design)
        noise, courses = assumed_noise(
            [stretch_rows(wide, piece, d, plain) for piece, d in zip(pieces, decimations, strict=True)],
            unseen + exact,
            {k: wide.position[k, wide.own_frictions(k).ravel()] for k in wide.restless if k not in design.restless},
        )
        restless = {k: spread_of(own) for k, own in courses.items()}
    if restless:
        design = with_own_frictions(design, restless | spreads_of(design))
    look = first_look(design, pieces, decimations, noise)
    holding = held(look, pieces, decimations, noise)
    rests = held_at(look, pieces, decimations, holding)
    # What frictions explain recurs too, and is no error: it says nothing of how large errors that recur may be. Nor do
    # rests, in which they hold a joint by one torque today and by another tomorrow, say how large the noise is.
    left, stands = (playings(repeats, grid, lay(pieces, own)) for own in (look.left, rests))
    noise = repeated_noise(rows, unseen, exact, left, stands) or noise
    again = max((len(group.occurrences) for group in repeats), default=1)
    noise = with_turns(look, pieces, decimations, noise, holding, again)
    parts = parts_of(recordings, repeats)
    blocks = [sheet.compact() for sheet in sheets(design, pieces, decimations, noise, parts)]
    folds = folds_of(blocks, recordings, repeats)
    return Evidence(
        design,
        grid,
        tuple(pieces),
        tuple(decimations),
        tuple(repeats),
        noise,
        unseen,
        tuple(blocks),
        folds,
        parts,
        cache(slow),
        recordings,
        unseen_without or (lambda ripple: unseen),
    )


def weighed_again(
    evidence: Evidence,
    design: Design,
    unseen: Array,
    pieces: Sequence[Stretch],
    slow: Callable[[], Sequence[Stretch]],
) -> Evidence:
    """`weighed` of the same recordings, of laws of another ``design``, beside other errors or along other motions."""
    own = evidence
    found = weighed(design, own.grid, pieces, slow, unseen, own.recordings, own.repeats, own.unseen_without)
    return replace(found, tolerance=own.tolerance, bend=own.bend, spent=own.spent, late=own.late)


def exactness(pieces: Sequence[Stretch]) -> Array:
    """(channels, ORDER + 1) autocovariance of errors than which nothing is computed more exactly."""
    power = mean_power(pieces)
    result = np.zeros((len(power), ORDER + 1))
    result[:, 0] = EXACT**2 * power + _LEAST**2
    return result


def _told_of(given: RigidBody, effect: Effect, place: Place) -> bool:
    """Whether the given model can be wrong in this way: a link without mass is free, and so is what it carries."""
    if effect.name not in ("link_inertia", "payload"):
        return True
    link = given.n - 1 if place.joint is None else place.joint
    return bool(given.prior()[10 * link] > 0.0)


def _played_again(
    grid: Grid, trajectories: Sequence[Trajectory], repeats: Sequence[RepeatGroup], ripple: Ripple
) -> Array:
    """(channels,) variance of the rows' white error that recurs in all playings, of torques without a ripple."""
    rate = min(trajectory.rate for trajectory in trajectories)
    torques = [t.tau - ripple(t.q) for t in trajectories]
    white = {"torque": repeated_white(trajectories, repeats, torques, grid.band)}
    speeds = [t.dq for t in trajectories if t.dq is not None]
    if len(speeds) == len(trajectories):
        white["velocity"] = repeated_white(trajectories, repeats, speeds, grid.band)
    return np.array([white[channel.equation][channel.index] for channel in grid.channels]) * 2.0 * grid.band / rate


def _unseen(grid: Grid, pieces: Sequence[Stretch], share: Array) -> Array:
    """(channels, ORDER + 1) autocovariance of the rows' errors that repeats do not show: rounding of the angles that
    recurs."""
    rounded = [Decimator(grid.decimation(piece.signals.period))(piece.rounding.T).T for piece in pieces]
    return np.asarray(autocovariance(rounded) * np.array([share[channel.index] for channel in grid.channels])[:, None])


def cut(body: RigidBody, grid: Grid, trajectories: Sequence[Trajectory]) -> list[Stretch]:
    """Gapless stretches of all recordings. Raises InputError when there is none that is long enough."""
    pieces = [piece for k, trajectory in enumerate(trajectories) for piece in stretches(body, grid, k, trajectory)]
    return told_by(pieces, trajectories[0].name)
