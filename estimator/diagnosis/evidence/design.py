"""All hypotheses about one arm as columns of one linear model, and the recordings' rows of those columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.diagnosis.observed.drives_off import OffReading
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.own_friction import OWN, courses, own_friction
from estimator.diagnosis.observed.stretches import Channel, Stretch
from estimator.diagnosis.observed.turning import settled
from estimator.effects import Law, Place, Scales, Signals
from estimator.filtering import Decimator
from estimator.rigid_body import RigidBody
from estimator.rows import make_layout

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_AT_ONCE = 24
"""Columns at least that are filtered together."""


@dataclass(frozen=True)
class Hypothesis:
    """One effect, or map, at one place."""

    effect: Law
    place: Place


@dataclass(frozen=True)
class Candidate:
    """A hypothesis with its non-linear parameters fixed."""

    hypothesis: int
    theta: Array
    columns: Indices
    """Its coefficients among all unknowns of the design."""
    channels: tuple[int, ...]
    """The channels it enters, in the order of the effect's rows, then of its speed rows."""
    lower: Array
    upper: Array
    """Limits of its coefficients."""
    named_for: tuple[int, ...] = ()
    """Which of its coefficients it cannot be without (`Law.named_for`)."""

    @cached_property
    def separable(self) -> NDArray[np.bool_]:
        """(c,) which coefficients may be absent from a law that stays the same: parts of a law that is nothing but such
        parts, and not what it is named for. A payload without mass is no payload."""
        result = np.full(len(self.columns), bool(np.all((self.lower == 0.0) | (self.upper == 0.0))))
        result[list(self.named_for)] = False
        return result


@dataclass(frozen=True)
class Design:
    """Unknowns: what the given model is allowed to be off by (deviations of its base parameters, each channel's timing
    within a part of a sample, and frictions that are others in each recording), then every candidate's coefficients."""

    body: RigidBody
    base: BaseParameters
    channels: tuple[Channel, ...]
    hypotheses: tuple[Hypothesis, ...]
    candidates: tuple[Candidate, ...]
    precision: Array
    """(given, given) inverse covariance of the deviations that are allowed: the given model's tolerance."""
    reached: tuple[Indices, ...]
    """For each channel the base parameters that enter it."""
    reading: OffReading | None = None
    """Of the torques with the drives off, where there is one."""
    restless: tuple[int, ...] = ()
    """Torques whose joint has a friction of its own in each recording."""
    vigour: Array = field(default_factory=lambda: np.zeros((0, 0, OWN)))
    """(recordings, channels, OWN) energy of `own_friction` in each recording."""

    @property
    def recordings(self) -> int:
        """Of which frictions may be told apart."""
        return len(self.vigour)

    @property
    def given(self) -> int:
        """Unknowns of the given model: base parameters, then one timing a channel, s, then the `own_frictions` of each
        of the ``restless``."""
        return self.base.rank + len(self.channels) + self._own * len(self.restless)

    @property
    def _own(self) -> int:
        """Of a restless torque, for each recording and for any other, as of a motion yet to be played."""
        return OWN * (self.recordings + 1)

    def own_frictions(self, channel: int) -> Indices:
        """(recordings + 1, OWN) unknowns of a restless torque, by how much `own_friction` differs from the causes': of
        each course over the recordings (`courses`), and of any other recording."""
        first = self.base.rank + len(self.channels) + self._own * self.restless.index(channel)
        return np.arange(first, first + self._own).reshape(-1, OWN)

    @cached_property
    def size(self) -> int:
        return self.given + sum(len(candidate.columns) for candidate in self.candidates)

    @cached_property
    def members(self) -> tuple[Indices, ...]:
        """For each channel the unknowns that enter it, ascending."""
        own: list[list[Indices]] = [
            [np.append(base, self.base.rank + channel)] for channel, base in enumerate(self.reached)
        ]
        for channel in self.restless:
            own[channel].append(self.own_frictions(channel).ravel())
        for candidate in self.candidates:
            for channel in candidate.channels:
                own[channel].append(candidate.columns)
        return tuple(np.concatenate(parts) for parts in own)

    @cached_property
    def position(self) -> NDArray[np.intp]:
        """(channels, size) where an unknown stands among a channel's members; −1: it does not enter."""
        result = np.full((len(self.channels), self.size), -1, dtype=np.intp)
        for channel, members in enumerate(self.members):
            result[channel, members] = np.arange(len(members))
        return result

    def believed(self, precision: Array) -> Design:
        """The same with the given model known to another precision."""
        other = replace(self, precision=precision)
        # The columns stay, and so does what was worked out of them.
        other.__dict__.update({name: x for name, x in self.__dict__.items() if name in ("size", "members", "position")})
        return other

    def with_candidates(self, candidates: Sequence[Candidate]) -> Design:
        """The same arm with other candidates, their columns numbered anew."""
        place, renumbered = self.given, []
        for c in candidates:
            columns = np.arange(place, place + len(c.columns))
            renumbered.append(replace(c, columns=columns))
            place += len(columns)
        # A copy made so has none of what was worked out of the former columns.
        return replace(self, candidates=tuple(renumbered))


def make_design(
    body: RigidBody,
    base: BaseParameters,
    channels: tuple[Channel, ...],
    hypotheses: Sequence[Hypothesis],
    scales: Scales,
    precision: Array,
) -> Design:
    """Lays out all hypotheses that enter a recorded channel, each on its grid of non-linear parameters."""
    active = make_layout(body, base, [()] * body.n).active if base.rank else ((),) * body.n
    nothing = np.zeros(0, dtype=np.intp)
    reached = tuple(
        np.array(active[channel.index], dtype=np.intp) if channel.equation == "torque" else nothing
        for channel in channels
    )
    where = {channel: k for k, channel in enumerate(channels)}
    empty = Design(body, base, channels, tuple(hypotheses), (), precision, reached)
    moment = _moment(body)
    candidates: list[Candidate] = []
    for number, hypothesis in enumerate(hypotheses):
        effect, place = hypothesis.effect, hypothesis.place
        enters = [Channel(effect.equation_at(place), row) for row in effect.rows(body, place)]
        if not all(channel in where for channel in enters):
            continue
        speeds = [Channel("velocity", joint) for joint in effect.speed_rows(body, place)]
        enters += [channel for channel in speeds if channel in where]
        grid = effect.grid(place, scales)
        free = np.full(effect.columns(place, moment, grid[0]).shape[2], np.inf)
        channels_in = tuple(where[c] for c in enters)
        for theta in grid:
            lower, upper = effect.limits(place, scales, theta) or (-free, free)
            columns = np.arange(len(lower))
            candidates.append(Candidate(number, theta, columns, channels_in, lower, upper, effect.named_for))
    return empty.with_candidates(candidates)


def linkless_design(
    body: RigidBody, channels: tuple[Channel, ...], hypotheses: Sequence[Hypothesis], scales: Scales, timings: Array
) -> Design:
    """Of equations in which no link enters, as between a motor and its joint's sensor; ``timings`` is the precision of
    the channels' own."""
    nothing = BaseParameters((), (), (), np.zeros(0), np.zeros((0, 10 * body.n)), (), (), ())
    return make_design(body, nothing, channels, hypotheses, scales, timings)


def _moment(body: RigidBody) -> Signals:
    """A moment of any motion, on which an effect shows how many coefficients it has."""
    t = np.arange(8) / 100.0
    q = np.sin(t)[:, None] * np.ones(body.n)
    dq = np.cos(t)[:, None] * np.ones(body.n)
    return Signals(body, t, q, dq, -q, np.zeros_like(q), np.zeros_like(q), dq)


def stretch_rows(design: Design, stretch: Stretch, decimation: int, noise: Noise) -> list[Array]:
    """For each channel (members + 1, rows): its whitened columns, the residual of the given model last."""
    decimate = Decimator(decimation)
    rows = max(-(-stretch.signals.samples // decimation) - noise.past, 0)
    sinks = [
        _Sink(
            channel,
            decimate,
            noise,
            np.empty((len(members) + 1, rows)),
            noise.of_turns(channel, stretch.signals.q, stretch.signals.dq, decimation),
        )
        for channel, members in enumerate(design.members)
    ]
    for channel, columns in _columns(design, stretch.signals, min(stretch.recording, design.recordings)):
        sinks[channel].take(columns)
    for sink, residual in zip(sinks, stretch.residual.T, strict=True):
        sink.take(residual[None])
        sink.filter()
    return [sink.rows for sink in sinks]


def read_rows(design: Design, reading: OffReading) -> list[Array]:
    """For each channel (members + 1, 1): what the torques read with the drives off, in its standard errors. Of all that
    a design holds, the offsets alone are there."""
    rows = [np.zeros((len(members) + 1, 1)) for members in design.members]
    for own, channel in zip(rows, design.channels, strict=True):
        if channel.equation == "torque":
            own[-1] = reading.offset[channel.index] / reading.error[channel.index]
    for candidate in design.candidates:
        hypothesis = design.hypotheses[candidate.hypothesis]
        if hypothesis.effect.read_off and hypothesis.place.joint is not None:
            (channel_in,) = candidate.channels
            places = design.position[channel_in][candidate.columns]
            rows[channel_in][places] = 1.0 / reading.error[hypothesis.place.joint]
    return rows


class _Sink:
    """Takes one channel's columns as they are made and keeps what the filters leave: the columns themselves live no
    longer than in the processor's cache."""

    def __init__(self, channel: int, decimate: Decimator, noise: Noise, rows: Array, turns: Array | None) -> None:
        self.rows = rows
        self._channel, self._decimate, self._noise, self._turns = channel, decimate, noise, turns
        self._filled = self._count = 0
        self._waiting: list[Array] = []

    def take(self, columns: Array) -> None:
        """(columns, samples)"""
        self._waiting.append(columns)
        self._count += len(columns)
        if self._count >= _AT_ONCE:
            self.filter()

    def filter(self) -> None:
        """What is waiting."""
        if self._waiting:
            whole = self._noise.whiten(self._channel, self._decimate(np.concatenate(self._waiting)))
            self.rows[self._filled : self._filled + len(whole)] = settled(self._turns, whole)
            self._filled += len(whole)
            self._count = 0
            self._waiting.clear()


def _columns(design: Design, signals: Signals, recording: int) -> Iterator[tuple[int, Array]]:
    """Channel and (columns, samples), each channel's in the order of its members."""
    kept, sign = np.array(design.base.kept, dtype=np.intp), design.base.sign
    still = signals.as_recorded
    slope = {"torque": signals.lagged(signals.slope(signals.tau_rigid)), "velocity": still.ddq, "deflection": still.dq}
    for number, (channel, reached) in enumerate(zip(design.channels, design.reached, strict=True)):
        if channel.equation == "torque":
            yield number, signals.lagged(signals.regressor[:, channel.index, kept[reached]] * sign[reached]).T
        # A channel that is late by δ reads x(t) − δ·dx/dt.
        yield number, -slope[channel.equation][:, [channel.index]].T
        if number in design.restless:
            own = signals.lagged(own_friction(signals, channel.index)).T
            yield number, (courses(design.vigour[:, number])[recording, :, :, None] * own).reshape(-1, signals.samples)
    for number, of_one in groupby(design.candidates, key=lambda candidate: candidate.hypothesis):
        candidates, hypothesis = list(of_one), design.hypotheses[number]
        thetas = [candidate.theta for candidate in candidates]
        made = hypothesis.effect.columns_of_each(hypothesis.place, _seen_by(hypothesis, signals), thetas)
        for candidate, columns in zip(candidates, made, strict=True):
            values = _as_recorded(hypothesis, candidate, signals, columns)
            for row, channel_index in enumerate(candidate.channels):
                yield channel_index, values[:, row].T


def candidate_columns(design: Design, candidate: Candidate, signals: Signals) -> Array:
    """(samples, channels, c) of a candidate, in the order of its channels."""
    hypothesis = design.hypotheses[candidate.hypothesis]
    columns = hypothesis.effect.columns(hypothesis.place, _seen_by(hypothesis, signals), candidate.theta)
    return _as_recorded(hypothesis, candidate, signals, columns)


def _seen_by(hypothesis: Hypothesis, signals: Signals) -> Signals:
    """The motion that a law's equation is about."""
    return signals if hypothesis.effect.equation_at(hypothesis.place) == "torque" else signals.as_recorded


def _as_recorded(hypothesis: Hypothesis, candidate: Candidate, signals: Signals, columns: Array) -> Array:
    """A candidate's columns, of torques as these are recorded, with those of the speeds where it enters them."""
    effect, place = hypothesis.effect, hypothesis.place
    # What is late is told of the motion as it was recorded.
    if effect.equation_at(place) == "torque" and effect.timed(place) is None:
        columns = signals.lagged(columns)
    if columns.shape[1] == len(candidate.channels):
        return columns
    speeds = hypothesis.effect.speed_columns(hypothesis.place, signals.as_recorded, candidate.theta)
    return np.concatenate([columns, speeds], axis=1)


def candidate_rows(
    design: Design, candidate: Candidate, stretch: Stretch, decimation: int, noise: Noise
) -> list[Array]:
    """For each channel that a candidate enters (c, rows): its whitened columns."""
    decimate, columns = Decimator(decimation), candidate_columns(design, candidate, stretch.signals)
    result = []
    for row, channel in enumerate(candidate.channels):
        turns = noise.of_turns(channel, stretch.signals.q, stretch.signals.dq, decimation)
        result.append(settled(turns, noise.whiten(channel, decimate(columns[:, row].T))))
    return result
