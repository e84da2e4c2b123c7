"""The hypotheses between which recordings leave a choice, and the algebra that says what more data would decide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional, Group, groups_of
from estimator.diagnosis.evidence.design import (
    Candidate,
    Design,
    Hypothesis,
    candidate_columns,
    read_rows,
    stretch_rows,
)
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import Block, part_of, total
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.typical import against_typical
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.drives_off import RECORDING, expected_reading
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.spending import Spent, along
from estimator.diagnosis.observed.stretches import Channel, Stretch
from estimator.diagnosis.observed.turning import Turning
from estimator.effects import Signals
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SAMPLES_A_ROW = 4
"""Of a motion that is only planned."""


@dataclass(frozen=True)
class Rival:
    """One hypothesis of a contest, on its grid of non-linear parameters."""

    hypothesis: Hypothesis
    candidates: Indices
    """Among the contest's design."""
    freedom: Array
    """(candidates,) physical parameters of each: what its support costs is in proportion. Of a law that makes other
    causes' torques as well, those of the finding: in the place of them all it costs no more than they do."""


@dataclass(frozen=True)
class Contest:
    """Rivals for one cause, the other causes that were found taken as found by both.

    The data so far are in ``known``, the rows' noise in ``noise``, and how much each channel is believed in
    ``weights``.
    """

    design: Design
    """The other causes' candidates first, then every rival's."""
    others: int
    """How many candidates are other causes'."""
    rivals: tuple[Rival, ...]
    """The finding, then what could stand in its stead."""
    known: Block
    weights: Array
    noise: Noise
    band: float
    """Hz of the rows."""
    body: RigidBody
    """Of whose torques the laws' columns are made (`Evidence.bend`)."""
    spent: tuple[Spent, ...] = ()
    """What motors give torque for beside that."""

    @property
    def active(self) -> Indices:
        """Unknowns that every rival shares: the given model's, and the other causes'."""
        last = self.design.given + sum(len(c.columns) for c in self.design.candidates[: self.others])
        return np.arange(last)

    @cached_property
    def _told(self) -> Weighted:
        return Weighted(self.design, self.known, self.weights)

    @property
    def rate(self) -> float:
        """Hz at which a planned motion is to be sampled."""
        return 2.0 * self.band * SAMPLES_A_ROW

    def planned(self, t: Array, q: Array, dq: Array, ddq: Array, playings: int = 1) -> Block:
        """What a motion sampled at `rate` would add, played so many times, its torques not known yet: Gram matrices
        whose last row is zero.

        ``t`` (samples,), ``q, dq, ddq`` (samples, n).
        """
        signals = along(Signals.of_motion(self.body, t, q, dq, ddq), self.spent)
        nothing = np.zeros((len(t), len(self.design.channels)))
        noise = self._with_rests(signals, playings)
        rows = stretch_rows(
            self.design, Stretch(self.design.recordings, signals, nothing, nothing, nothing[0]), SAMPLES_A_ROW, noise
        )
        return Block(0, rows[0].shape[1], [x @ x.T for x in rows]).times(playings)

    def planned_reading(self, seconds: float) -> Block:
        """What so many seconds with the drives off would add, as `planned` has it."""
        torques = [k for k, channel in enumerate(self.design.channels) if channel.equation == "torque"]
        rows = read_rows(self.design, expected_reading(self.noise, torques, seconds, self.band))
        return Block(RECORDING, 1, [x @ x.T for x in rows])

    def _with_rests(self, signals: Signals, playings: int) -> Noise:
        """The noise of a planned motion: a joint that rubs is held by any part of its friction while it stands, and by
        the same part in each playing, so that rests tell little of it."""
        turning = dict(self.noise.turning)
        for number, channel in enumerate(self.design.channels):
            held = self._friction(signals, channel) if channel.equation == "torque" else 0.0
            if held > 0.0 or number in turning:
                own = turning.get(number, Turning(channel.index, 0.0, 1.0))
                turning[number] = replace(own, held=np.sqrt(playings) * held)
        return replace(self.noise, turning=turning)

    def _friction(self, signals: Signals, channel: Channel) -> float:
        """N·m of a joint's dry friction, as the data so far give it: the most that any of the hypotheses has here."""
        result = 0.0
        for value in self._values:
            for candidate in self.design.candidates:
                hypothesis, own = self.design.hypotheses[candidate.hypothesis], value[candidate.columns]
                if hypothesis.effect.dry and hypothesis.place.joint == channel.index and np.any(own):
                    torque = candidate_columns(self.design, candidate, signals)[:, 0] @ own
                    result = max(result, float(np.abs(torque).max()))
        return result

    @cached_property
    def _values(self) -> list[Array]:
        """For each rival the unknowns with it (`_fitted`)."""
        return [self._fitted(rival) for rival in self.rivals]

    def support(self, block: Block) -> Array:
        """(rivals,) nats by which each rival explains a block, less what its freedom costs."""
        gains = Conditional(Weighted(self.design, block, self.weights), self.active).gains(self._groups())
        return np.array([float(np.max(self._supported(rival, gains, block.rows))) for rival in self.rivals])

    def expected_gaps(self, planned: Block) -> Array:
        """(rivals, rivals) nats by which rival b is expected to be behind rival a after the planned motion, a being
        the truth with the parameters that the data so far give it.

        What of a's torque b cannot imitate, and with it the given model within its tolerance and all that the data so
        far leave free: the T-criterion (Atkinson and Fedorov 1975), ½‖·‖² in units of the noise. Between the finding
        and a law that contains it: what all data then say against what things of that name usually have.
        """
        result = np.zeros((len(self.rivals),) * 2)
        blocks = [total([self.known, self._following(planned, value)]) for value in self._values]
        for a, block in enumerate(blocks):
            support = self.support(block)
            result[a] = support[a] - support
        for a, rival in enumerate(self.rivals):
            gap = self._against_typical(blocks[0], rival)
            if gap is not None:
                result[0, a] = result[a, 0] = gap
        return result

    def _against_typical(self, block: Block, rival: Rival) -> float | None:
        """nats by which data speak against a rival beside the finding, where it has the form of a plainer law that the
        finding is, or contains, at the same place, and its usual form is known. None where the finding is a
        form of that law itself, or the rival makes the torque of another cause there as well: a joint that rubs more
        one way, as an offset makes it, may do so in any degree."""
        finding, place = self.rivals[0], rival.hypothesis.place
        others = (self.design.hypotheses[c.hypothesis] for c in self.design.candidates[: self.others])
        made = any(h.place == place and h.effect.name in rival.hypothesis.effect.made_with for h in others)
        form = bool(finding.hypothesis.effect.typical)
        if rival is finding or made or form or place != finding.hypothesis.place:
            return None
        own = self._best(finding).columns
        model = Conditional(Weighted(self.design, block, self.weights), np.concatenate([self.active, own]))
        law, alike = rival.hypothesis.effect, [self.design.candidates[k] for k in rival.candidates]
        shapes = [candidate.columns for candidate in alike if law.usual(candidate.theta)]
        return against_typical(model, finding.hypothesis.effect, own, law, shapes)

    def _best(self, rival: Rival) -> Candidate:
        """A rival's candidate that the data so far support best."""
        gains = Conditional(self._told, self.active).gains(self._groups())
        supported = self._supported(rival, gains, self.known.rows)
        best: Candidate = self.design.candidates[rival.candidates[int(np.argmax(supported))]]
        return best

    @staticmethod
    def _supported(rival: Rival, gains: Array, rows: float) -> Array:
        """(candidates,) of a rival's, the ``gains`` in so many rows less what their freedom costs."""
        return np.asarray(gains[rival.candidates] - 0.5 * np.log(rows) * rival.freedom)

    def _fitted(self, rival: Rival) -> Array:
        """(size,) unknowns of the rival's best candidate, fitted to the data so far, within its limits."""
        own = self._best(rival)
        active = np.concatenate([self.active, own.columns])
        value = np.zeros(self.design.size)
        value[active] = Conditional(self._told, active).value
        value[own.columns] = np.clip(value[own.columns], own.lower, own.upper)
        return value

    def _following(self, planned: Block, value: Array) -> Block:
        """The planned motion with the torques that these unknowns give it."""
        grams = []
        for gram, members in zip(planned.grams, self.design.members, strict=True):
            filled = gram.copy()
            products = gram[:-1, :-1] @ value[members]
            filled[:-1, -1] = filled[-1, :-1] = products
            filled[-1, -1] = value[members] @ products
            grams.append(filled)
        return Block(planned.recording, planned.rows, grams)

    def _groups(self) -> list[Group]:
        return groups_of(self.design, np.arange(self.others, len(self.design.candidates)))


def contest(scores: Scores, evidence: Evidence, others: Sequence[int], hypotheses: Sequence[int]) -> Contest:
    """Between ``hypotheses`` (indices of the search's design), the candidates ``others`` being other causes.

    The first hypothesis is the finding.
    """
    own = [np.flatnonzero(scores.owner == h) for h in hypotheses]
    chosen = [*others, *(int(k) for k in np.concatenate(own))]
    design, (known,) = part_of(scores.design, [scores.total], chosen)
    rivals, place = [], len(others)
    for number, candidates in zip(hypotheses, own, strict=True):
        law = scores.design.hypotheses[number]
        freedom = np.array([float(scores.size(int(k))) for k in candidates])
        if _makes_some(scores, law, others):
            freedom[:] = min(scores.size(int(k)) for k in own[0])
        here = np.arange(place, place + len(candidates))
        rivals.append(Rival(law, here, freedom))
        place += len(candidates)
    given, bend = design.body, evidence.bend
    body = given if bend is None else given.with_parameters(given.prior() + bend)
    weights, band = scores.weights.copy(), evidence.grid.band
    return Contest(design, len(others), tuple(rivals), known, weights, evidence.noise, band, body, evidence.spent)


def _makes_some(scores: Scores, law: Hypothesis, others: Sequence[int]) -> bool:
    """Whether a law makes the torque of some of the other causes as well, as an asymmetric friction does that of a
    symmetric one beside which an offset was found."""
    beside = (scores.hypothesis(k) for k in others)
    return any(h.place == law.place and h.effect.name in {*law.effect.contains, *law.effect.made_with} for h in beside)
