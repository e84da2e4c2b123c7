"""Frictions of which each recording has its own: how much they differ, and what that explains.

A joint that warmed up between two recordings rubs less in the second, and nothing that was recorded says by how much.
Such frictions are unknowns of the given model, with a variance that the recordings tell (maximum likelihood of the
second type by expectation and maximisation; Dempster, Laird and Rubin 1977). They differ about none: what recordings
have in common is the causes'.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.grams import sum_up, total
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.own_friction import OWN, own_friction
from estimator.diagnosis.observed.stretches import Stretch

Array = NDArray[np.float64]

_ROUNDS = 20
_LEAST = 1e-9
"""N·m, N·m·s/rad: by less nothing differs. rms of a torque, or of a friction of size one, of a joint that stands."""
_SEVERAL = 4
"""Recordings, of which none was played twice, that may tell frictions of their own: of fewer, of different speeds, the
form of one friction looks like several."""
_NONE = 1e12
"""Times more than the others their mean over the recordings is known: it is nothing."""


def fitted_with_own(
    design: Design,
    channels: Collection[int],
    pieces: Sequence[Stretch],
    decimations: Sequence[int],
    noise: Noise,
    weights: Array,
) -> Conditional:
    """All of the design fitted with frictions of their own in each recording for these torques, believed to differ as
    much as the recordings tell beside its candidates."""
    most = {channel: _size(design, channel, pieces) for channel in channels}
    own = with_own_frictions(design, most)
    own = own.believed(apart_by(own))
    told = Weighted(own, total(sum_up(own, pieces, decimations, noise)), weights)
    for _ in range(_ROUNDS):
        model = Conditional(told, np.arange(own.size))
        spent = np.square(model.value) + np.diag(model.covariance)
        spreads = {}
        for channel in channels:
            # Of the courses as much as of the recordings, for they are orthonormal.
            spreads[channel] = np.sqrt(spent[own.own_frictions(channel)[:-1]].mean(axis=0))
        own = own.believed(_with_spreads(own, spreads))
        told = told.believed(own.precision)
    return Conditional(told, np.arange(own.size))


def with_own_frictions(design: Design, spreads: Mapping[int, Array]) -> Design:
    """The design with frictions of their own in each recording for some torques, of the standard deviations
    ``spreads`` (OWN,); those that it had are replaced."""
    known = design.base.rank + len(design.channels)
    wide = replace(design, restless=tuple(sorted(spreads)))
    precision = block_diag(design.precision[:known, :known], np.zeros((wide.given - known,) * 2))
    wide = replace(wide, precision=precision)
    return replace(wide, precision=_with_spreads(wide, spreads, _NONE)).with_candidates(design.candidates)


def vigour_of(design: Design, pieces: Sequence[Stretch], recordings: int) -> Array:
    """`Design.vigour` of these recordings; of channels that are no torques, nothing."""
    result = np.zeros((recordings, len(design.channels), OWN))
    for piece in pieces:
        for channel, told in enumerate(design.channels):
            if told.equation == "torque":
                result[piece.recording, channel] += np.sum(own_friction(piece.signals, told.index) ** 2, axis=0)
    return result


def with_all_own(design: Design) -> Design:
    """The design with own frictions of all torques, of any size; of few recordings, as it is."""
    if design.recordings < _SEVERAL:
        return design
    torques = [k for k, channel in enumerate(design.channels) if channel.equation == "torque"]
    return with_own_frictions(design, {k: np.ones(OWN) for k in torques})


def spread_of(courses: Array) -> Array:
    """(OWN,) standard deviations of own frictions of which each course has so much (OWN·(recordings + 1),), that which
    all recordings have being the causes'."""
    return np.asarray(np.sqrt(np.mean(courses.reshape(-1, OWN)[1:-1] ** 2, axis=0)))


def spreads_of(design: Design) -> dict[int, Array]:
    """By restless torque, the standard deviations (OWN,) that its own frictions are believed to have."""
    told = np.diag(design.precision)
    return {channel: told[design.own_frictions(channel)[-1]] ** -0.5 for channel in design.restless}


def apart_by(design: Design) -> Array:
    """The design's precision where own frictions may have a mean beside the causes'."""
    return _with_spreads(design, spreads_of(design))


def by_other_recordings(model: Conditional) -> Array:
    """(active, active) covariance that the unknowns have besides, as they would be others of other recordings: what
    takes up the mean of frictions of which these were drawn."""
    design = model.design
    result = np.zeros((len(model.active),) * 2)
    for channel, spread in spreads_of(design).items():
        mean = design.own_frictions(channel)[0]
        response = model.solve(model.told.of_active(model.active, mean)) * spread
        result += response @ response.T
    return result


def of_own_frictions(model: Conditional, channel: int) -> float:
    """Mean square of what a restless torque's own frictions spend, in the noise's variance."""
    design, block = model.design, model.told.block
    own = design.own_frictions(channel).ravel()
    value = model.value[own]
    places = design.position[channel, own]
    return float(value @ block.grams[channel][np.ix_(places, places)] @ value) / block.rows


def _with_spreads(design: Design, spreads: Mapping[int, Array], of_mean: float = 1.0) -> Array:
    """The design's precision with own frictions of these standard deviations, ``of_mean`` times that of their mean."""
    precision = design.precision.copy()
    for channel, spread in spreads.items():
        own = design.own_frictions(channel)
        precision[own, own] = np.maximum(spread, _LEAST) ** -2.0
        precision[own[0], own[0]] *= of_mean
    return precision


def _size(design: Design, channel: int, pieces: Sequence[Stretch]) -> Array:
    """(OWN,) of the frictions that would be all of a torque."""
    joint = design.channels[channel].index
    torque = max(float(np.sqrt(np.mean([piece.power[channel] for piece in pieces]))), _LEAST)
    columns = np.concatenate([own_friction(piece.signals, joint) for piece in pieces])
    return np.asarray(torque / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), _LEAST))
