"""How well the given model explains recordings, its links believed to a share that no scale or drawing misses by.

A free body of the right kinematics fits almost any torques a little; that these links, give or take a third and a load
at the tool, should have made them is a far sharper question.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.diagnosis.observed.tolerance import base_precision
from estimator.plausibility.snapshot import ORDERS, TERMS, Snapshot, friction_terms, rms
from estimator.regressor import inverse_dynamics, torque_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_TOLERANCE = 0.3
"""Relative standard deviation of each link's parameters: more than drawings, cables and covers are off by, and far
less than another arm is."""
_LOAD, _LOAD_REACH = 0.3, 0.2
"""A load that the model does not know: standard deviation of its mass, share of the arm's, and m from the flange."""
_FLOOR = 0.1
"""Of a joint's torque: how exactly a rigid body with Coulomb friction is expected to fit anything."""
_THINNED = 3
"""Every so-manieth sample of a snapshot: hypotheses are told apart by tens of percents."""
_RIDGE = 1e-9
_LEAST_ROWS = 60
_AS_GIVEN = 0.3
"""Logarithm of a factor. Recordings of right arms of six and seven joints reach 0.15 beside cogging in every joint that
is as strong as all else, and 0.1 beside springs, walls and friction that are three times as strong; of an arm of which
a joint moved that was said to stand still 0.35, and of other arms 2.2 and more."""
_SIGNED = TERMS - 1
"""Of a joint's terms, those that cannot be negative: two frictions and a rotor, which come first."""


@dataclass(frozen=True)
class Judged:
    """(n,) each, NaN where a joint does not move: shares of the joint's rms torque."""

    left: Array
    """That model, load, friction, rotor and offset leave."""
    alone: Array
    """That friction, rotor and offset alone leave."""
    expected: Array
    """Of ``alone``, what the model as given says it should be, up to its sign: how visible the links are."""
    there: Array
    """Times that the torques of the model as given are there, beside what goes with each joint's own speed, angle and
    acceleration: one of the arm that moved, however large is what its model lacks."""

    @property
    def seen(self) -> bool:
        """Whether the given model's torques are there, in a typical joint, about as large as they should be."""
        return bool(np.nanmedian(np.abs(np.log(np.maximum(self.there, 1e-9)))) < _AS_GIVEN)

    @property
    def share(self) -> float:
        """Of what friction, rotor and offset leave, what the model leaves as well; in a typical joint."""
        return float(np.exp(np.nanmean(np.log(np.maximum(self.left, 1e-9) / np.maximum(self.alone, 1e-9)))))


@dataclass(frozen=True)
class Foretold:
    """Of a joint, where it moves."""

    torque: Array
    """(samples,) as it is foretold"""
    came: Array
    """(samples,) as it came"""
    error: float
    """rms of the standard error of what is foretold, about its mean, and of what was left of the joint's torque where
    it was learnt: large where that does not tell of such a motion."""


class GivenModel:
    """The given model as a prior that recordings, or other readings of them, are held against."""

    def __init__(self, body: RigidBody, base: BaseParameters) -> None:
        self.body, self._base = body, base
        prior = body.prior()
        self._beta = np.asarray(base.combination @ prior)
        covariance = np.linalg.inv(base_precision(body, base, _TOLERANCE))
        load = _LOAD * float(prior[::10].sum())
        spread = load * np.array([1.0, *[_LOAD_REACH] * 3, *[_LOAD_REACH**2] * 6])
        reaches = base.combination[:, -10:] * spread
        self._precision: Array = np.asarray(np.linalg.inv(covariance + reaches @ reaches.T), dtype=float)
        # Readings that exchange torques alone share their regressor.
        self._seen: tuple[Array, Array] | None = None

    def left(self, shot: Snapshot, sprung: bool = False) -> Array | None:
        """(n,) as `Judged.left`, of a `thinned` snapshot; None when too little moves to say. ``sprung``: beside any
        spring or counterbalance of each joint, too, that goes with its angle."""
        if self._seen is None or self._seen[0] is not shot.q:
            self._seen = shot.q, self._columns(shot)
        terms = np.concatenate([friction_terms(shot), _springs(shot)], axis=2) if sprung else friction_terms(shot)
        return _left(shot, self._seen[1], self._precision, self._beta, terms)

    def foretold(self, learnt: Snapshot, other: Snapshot) -> list[Foretold] | None:
        """By joint the torques of another snapshot, as this model foretells them once it has been fitted to the one
        that was learnt from. None when too little moves to say."""
        system = _system(learnt, self._columns(learnt), friction_terms(learnt))
        if system.rows < _LEAST_ROWS:
            return None
        unknowns = _solved(system, self._precision, self._beta)
        gram, _, scale = _normal(system, self._precision, self._beta)
        covariance = np.linalg.inv(gram) / np.outer(scale, scale)
        told = []
        misfits = [rms(y - x @ unknowns) / weight for (x, y), weight in zip(system.blocks, system.weights, strict=True)]
        for misfit, (block, came) in zip(
            misfits, _blocks(other, self._columns(other), friction_terms(other)), strict=True
        ):
            centred = block - block.mean(axis=0) if len(block) else block
            error = np.sqrt(np.einsum("ij,jk,ik->i", centred, covariance, centred))
            told.append(Foretold(block @ unknowns, came, float(np.hypot(rms(error), misfit))))
        return told

    def _columns(self, shot: Snapshot) -> Array:
        return self._base.select(torque_regressor(self.body, shot.q, shot.dq, shot.ddq))

    def judged(self, shot: Snapshot) -> Judged | None:
        """Model, and what is expected of it, against friction alone, on a `thinned` snapshot; None when too little
        moves to say."""
        left = self.left(shot)
        if left is None:
            return None
        n = self.body.n
        alone = _left(shot, np.zeros((len(shot.q), n, 0)), np.zeros((0, 0)), np.zeros(0), friction_terms(shot))
        assert alone is not None
        model = inverse_dynamics(self.body, self.body.prior(), shot.q, shot.dq, shot.ddq)
        terms = friction_terms(shot)
        sprung = np.concatenate([terms, _springs(shot)], axis=2)
        expected, there = np.full(n, np.nan), np.full(n, np.nan)
        for joint in range(n):
            here = shot.moving[:, joint] & shot.usable[:, joint]
            if here.any():
                pair = np.column_stack([model[here, joint], shot.tau[here, joint]])
                x, y = _left_beside(terms[here, joint], pair).T
                expected[joint] = rms(x) / max(rms(y), 1e-12)
                x, y = _left_beside(sprung[here, joint], pair).T
                there[joint] = float(x @ y) / max(float(x @ x), 1e-12)
        return Judged(left, alone, expected, there)


def thinned(shot: Snapshot) -> Snapshot:
    """A snapshot small enough to try a hundred readings of it."""
    some = slice(None, None, _THINNED)
    kept = {name: getattr(shot, name)[some] for name in ORDERS["joint order"]}
    return replace(shot, **kept)


@dataclass(frozen=True)
class _System:
    """Weighted equations of a snapshot, joint after joint: base parameters, then friction, rotor and offset a joint,
    and what else goes with it."""

    blocks: list[tuple[Array, Array]]
    """Rows and right-hand side of each joint, where it moves and its torque says something."""
    weights: list[float]
    """1/(N·m) of each joint's."""
    rank: int
    terms: int
    """Of each joint."""

    @property
    def rows(self) -> int:
        return sum(len(target) for _, target in self.blocks)


def _left_beside(columns: Array, torques: Array) -> Array:
    """What is left of torques, or several, that are fitted by columns of their own."""
    scaled = columns / np.maximum(np.abs(columns).max(axis=0), 1e-12)
    return np.asarray(torques - scaled @ np.linalg.lstsq(scaled, torques, rcond=1e-8)[0])


def _springs(shot: Snapshot) -> Array:
    """(samples, n, 3) torques that go with each joint's own angle, as those of springs and counterbalances do."""
    return np.stack([shot.q, np.sin(shot.q), np.cos(shot.q)], axis=2)


def _system(shot: Snapshot, columns: Array, terms: Array) -> _System:
    """``columns`` (samples, n, rank) of the base parameters; ``terms`` (samples, n, terms) of each joint."""
    blocks, weights = [], []
    for block, torque in _blocks(shot, columns, terms):
        weights.append(1.0 / (_FLOOR * max(rms(torque), 1e-12)))
        blocks.append((weights[-1] * block, weights[-1] * torque))
    return _System(blocks, weights, columns.shape[2], terms.shape[2])


def _blocks(shot: Snapshot, columns: Array, terms: Array) -> Iterator[tuple[Array, Array]]:
    """Of each joint, where it moves and its torque says something, (rows, unknowns) the columns of all unknowns and
    (rows,) its torque."""
    n, rank, own = shot.q.shape[1], columns.shape[2], terms.shape[2]
    for joint in range(n):
        here = shot.moving[:, joint] & shot.usable[:, joint]
        block = np.zeros((int(here.sum()), rank + own * n))
        block[:, :rank] = columns[here, joint]
        block[:, rank + own * joint : rank + own * (joint + 1)] = terms[here, joint]
        yield block, shot.tau[here, joint]


def _left(shot: Snapshot, columns: Array, precision: Array, beta: Array, terms: Array) -> Array | None:
    """(n,) share that is left by base parameters near ``beta`` (rank,), with friction and rotors that are not
    negative, and an offset a joint and what else is in ``terms``. ``columns`` (samples, n, rank)."""
    system = _system(shot, columns, terms)
    if system.rows < _LEAST_ROWS:
        return None
    unknowns = _solved(system, precision, beta)
    return np.array([_FLOOR * rms(y - x @ unknowns) if len(y) else np.nan for x, y in system.blocks])


def _solved(system: _System, precision: Array, beta: Array) -> Array:
    rank, size = system.rank, system.blocks[0][0].shape[1]
    gram, right, scale = _normal(system, precision, beta)
    bounded = np.arange(size) >= rank
    for joint in range(rank, size, system.terms):
        bounded[joint + _SIGNED : joint + system.terms] = False
    unknowns, free = np.zeros(size), np.ones(size, dtype=np.bool_)
    while True:
        unknowns[:] = 0.0
        unknowns[free] = np.linalg.solve(gram[np.ix_(free, free)], right[free])
        negative = bounded & (unknowns < 0.0)
        if not negative.any():
            break
        free &= ~negative
    return np.asarray(unknowns / scale)


def _normal(system: _System, precision: Array, beta: Array) -> tuple[Array, Array, Array]:
    """Matrix and right-hand side of the normal equations of the unknowns times their ``scale``, and that."""
    rank, size = system.rank, system.blocks[0][0].shape[1]
    gram, right = np.zeros((size, size)), np.zeros(size)
    gram[:rank, :rank], right[:rank] = precision, precision @ beta
    for block, target in system.blocks:
        gram += block.T @ block
        right += block.T @ target
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0.0] = 1.0
    return gram / np.outer(scale, scale) + _RIDGE * np.eye(size), right / scale, scale
