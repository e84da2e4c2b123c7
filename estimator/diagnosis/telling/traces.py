"""Residuals over time, and each finding against the quantity that shows its form: what pictures are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design, candidate_columns, stretch_rows
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.torques import torque_channels
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import Channel, Grid, Stretch
from estimator.effects import Signals
from estimator.filtering import Decimator
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_CURVE = 6000
"""Points of a law's curve that are kept."""
_EDGE = 12
"""Rows at either end of a stretch whose decimation reaches beyond the data."""
_UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s²", "tau": "N·m", "t": "s", "temperature": "°C"}
_WORDS = {
    "q": "angle",
    "dq": "speed",
    "ddq": "acceleration",
    "tau": "torque",
    "t": "time",
    "temperature": "temperature",
}
_SLIDING = {"angle": "position", "torque": "force"}
"""What a sliding joint has instead."""


@dataclass(frozen=True)
class Signature:
    """One finding against what it depends on, on the channel where it stands out most.

    Attributes:
        quantity, unit: what ``x`` is.
        channel, channel_unit: what ``measured`` and ``law`` are.
        x: (rows,)
        measured: (rows,) the residual with everything else that was found taken off.
        law: (rows,) what the finding's law says of it, filtered as the rows are.
        curve_x, curve: (points,) the law itself, before the rows' filter rounds its corners.
    """

    quantity: str
    unit: str
    channel: str
    channel_unit: str
    x: Array
    measured: Array
    law: Array
    curve_x: Array
    curve: Array


@dataclass(frozen=True)
class Traces:
    """Torque residuals of one recording in the compared band.

    Attributes:
        recording: number among those that were given.
        t: (rows,) s; a row of NaN in ``before`` and ``after`` marks a gap.
        before, after: (rows, joints) N·m (N of a sliding joint), of the given model and of the extended one.
        noise: (joints,) rms, likewise.
        signatures: one a finding, over all recordings.
    """

    recording: int
    t: Array
    before: Array
    after: Array
    noise: Array
    signatures: tuple[Signature, ...]


def traces(
    refined: Refined,
    learnt: Sequence[Stretch],
    shown: Sequence[Stretch],
    grid: Grid,
    noise: Array,
    names: Sequence[str],
) -> Traces:
    """Residuals of the longest recording in ``shown``, signatures over all that was ``learnt`` from.

    ``noise`` (channels,) rms, ``names`` of the joints.
    """
    design = refined.design
    rows = [_Rows.of(design, piece, grid.decimation(piece.signals.period)) for piece in shown]
    lengths: dict[int, int] = {}
    for r in rows:
        lengths[r.recording] = lengths.get(r.recording, 0) + len(r.t)
    recording = max(lengths, key=lambda k: lengths[k])
    torques = torque_channels(design)
    t, before, after = [], [], []
    for r in rows:
        if r.recording == recording:
            gap = np.full((1, len(torques)), np.nan)
            t += [r.t, r.t[-1:]]
            before += [np.array([r.channels[k][-1] for k in torques]).T, gap]
            after += [r.residual(refined.value)[:, torques], gap]
    return Traces(
        recording,
        np.concatenate(t),
        np.concatenate(before),
        np.concatenate(after),
        noise[torques],
        signatures(refined, learnt, grid, noise, names),
    )


def signatures(
    refined: Refined, learnt: Sequence[Stretch], grid: Grid, noise: Array, names: Sequence[str]
) -> tuple[Signature, ...]:
    """One a candidate of the refined model, over all stretches; ``noise`` and ``names`` as for `traces`."""
    design = refined.design
    known = [_Rows.of(design, piece, grid.decimation(piece.signals.period)) for piece in learnt]
    return tuple(_signature(refined, number, known, noise, names) for number in range(len(design.candidates)))


@dataclass(frozen=True)
class _Rows:
    """One stretch on the rows' grid; ``channels``: for each (members + 1, rows), the residual last."""

    recording: int
    t: Array
    channels: list[Array]
    design: Design
    signals: Signals
    decimation: int

    @classmethod
    def of(cls, design: Design, piece: Stretch, decimation: int) -> _Rows:
        rows = stretch_rows(design, piece, decimation, Noise.none(len(design.channels), past=0))
        edge = _EDGE if rows[0].shape[1] > 4 * _EDGE else 0
        kept = slice(edge, rows[0].shape[1] - edge)
        times = piece.signals.t[::decimation]
        return cls(piece.recording, times[kept], [x[:, kept] for x in rows], design, piece.signals, decimation)

    def residual(self, value: Array) -> Array:
        """(rows, channels)"""
        pairs = zip(self.channels, self.design.members, strict=True)
        return np.array([x[-1] - value[members] @ x[:-1] for x, members in pairs]).T

    def law(self, refined: Refined, candidate: int, channel: int) -> Array:
        """(rows,) what a candidate adds to a channel."""
        columns = self.design.candidates[candidate].columns
        return np.asarray(refined.value[columns] @ self.channels[channel][self.design.position[channel, columns]])

    def values(self, name: str) -> Array:
        """(samples, joints) of a quantity, before the rows' filter."""
        return self.signals.tau_rigid if name == "tau" else np.asarray(getattr(self.signals, name))

    def curve(self, refined: Refined, number: int, channel: int) -> Array:
        """(samples,) what a candidate adds to a channel, before the rows' filter."""
        candidate = self.design.candidates[number]
        columns = candidate_columns(self.design, candidate, self.signals)
        return np.asarray(columns[:, candidate.channels.index(channel)] @ refined.coefficients(number))

    def quantity(self, name: str, joint: int) -> Array:
        """(rows,) of one joint, filtered as the rows are."""
        whole = Decimator(self.decimation)(self.values(name)[:, joint][None])[0]
        edge = (len(whole) - len(self.t)) // 2
        # The decimating kernel keeps the power of white noise, not the mean: its gain at rest is taken off again.
        gain = Decimator(self.decimation)(np.ones((1, self.signals.samples)))[0]
        return np.asarray(whole / gain)[edge : len(whole) - edge]


def _signature(refined: Refined, number: int, rows: Sequence[_Rows], noise: Array, names: Sequence[str]) -> Signature:
    candidate = refined.design.candidates[number]
    hypothesis = refined.design.hypotheses[candidate.hypothesis]
    channel = max(
        candidate.channels,
        key=lambda c: float(np.mean(np.concatenate([r.law(refined, number, c) for r in rows]) ** 2)) / noise[c] ** 2,
    )
    law = np.concatenate([r.law(refined, number, channel) for r in rows])
    measured = law + np.concatenate([r.residual(refined.value)[:, channel] for r in rows])
    where: Channel = refined.design.channels[channel]
    body = refined.design.body
    said = _said(body, where.equation, where.index, names)
    unit = unit_of_channel(body, where)
    against = hypothesis.effect.seen_at(candidate.theta)
    joint = hypothesis.place.joint
    if against == "law" or (joint is None and against != "t"):
        return Signature("what the finding predicts", unit, said, unit, law, measured, law, law, law)
    curve = np.concatenate([r.curve(refined, number, channel) for r in rows])
    if joint is None or against == "t":
        x, whole = (np.concatenate(parts) for parts in ([r.t for r in rows], [r.signals.t for r in rows]))
        quantity, x_unit = _WORDS["t"], _UNITS["t"]
    else:
        x = np.concatenate([r.quantity(against, joint) for r in rows])
        whole = np.concatenate([r.values(against)[:, joint] for r in rows])
        quantity = _said(body, _WORDS[against], joint, names)
        x_unit = body.axes[joint].unit(_UNITS[against])
    few = slice(None, None, max(1, len(whole) // _CURVE))
    return Signature(quantity, x_unit, said, unit, x, measured, law, whole[few], curve[few])


def unit_of_channel(body: RigidBody, channel: Channel) -> str:
    """Of a channel of a joint; a sliding joint's are those of a slide."""
    return body.axes[channel.index].unit({"torque": "N·m", "velocity": "rad/s", "deflection": "rad"}[channel.equation])


def _said(body: RigidBody, word: str, joint: int, names: Sequence[str]) -> str:
    """``torque of elbow``, of a sliding joint ``force of slide``."""
    return f"{word if body.axes[joint].revolute else _SLIDING.get(word, word)} of {names[joint]}"
