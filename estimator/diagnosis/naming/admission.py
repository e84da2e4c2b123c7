"""What a cause must be to be believed: beyond chance, no trifle, told apart, within limits, borne out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.borne_out import BORNE_OUT
from estimator.diagnosis.evidence.forms import OF_FRICTION
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.observed.drives_off import OffReading

Array = NDArray[np.float64]

FALSE_ALARM = 0.002
"""Family-wise probability of a false alarm that a step may have: far below the one in twenty that is promised, since it
is worked out from a noise that is itself estimated, and a diagnosis takes several steps."""
INSTEAD = 0.05
"""Likewise, of what takes the place of a cause that has less: that there is something was asked of that one."""
_LEAST_SHARE = 0.04
"""Of the explainable that is left in its channels, what a cause must explain."""
_REST = 10.0
"""Times what is surely left beyond the noise that a cause explains which completes the model; where the noise is
assumed, so that nothing tells whether the others' laws fit, at least the noise."""
_SEEN = 3.0
"""Likewise, times what is seen to be left as a function of something: mostly the shapes of the grid, before they are
refined."""
LEAST_SEEN = 0.01
"""Of the noise's variance in one of its channels, what a cause must explain: a tenth of its standard deviation.
However long the recordings, the noise itself and the angles that columns are made of are known no better."""
RECURRING = 0.75
"""Of what a cause explains, the share that must be there with angles that have other errors …"""
_SLOWLY = 0.5
"""… and of a dry friction: where a joint hardly moves, other errors of its angle are another sign of its speed."""
_OF_DRY_FRICTION = 2e-4
"""Of what dry frictions explain in its channels, what any other cause must: their laws are exact to a seventieth of
their torque at best, however small the noise is and however well all is explained with it."""
_TOLD_APART = 0.01
"""Of a candidate's columns' energy, what each cause already chosen must leave: a canonical correlation of 0.995."""
_A_SPECTRUM = 8
"""Lines that tell how much others of their law explain …"""
_AMONG_LINES = 0.05
"""… and the probability that one of them explains so much by chance."""
_TRIED = 4
"""Hypotheses that are asked, the best supported first."""


class Admission:
    """Judges candidates beside those already chosen, by their scores at the present weights."""

    def __init__(self, scores: Scores) -> None:
        self.scores = scores
        self.design = scores.design

    def admitted(self, candidate: int, chosen: list[int], false_alarm: float = FALSE_ALARM) -> bool:
        """Whether a cause may join those already chosen. The dearest questions last: a fit to each fold, and columns
        made anew."""
        return self.borne_out(candidate, chosen, false_alarm) and self.recurs(candidate, chosen)

    def borne_out(self, candidate: int, chosen: list[int], false_alarm: float = FALSE_ALARM) -> bool:
        """Whether a cause is beyond chance, no trifle, told apart, and borne out by rows left out."""
        gain = float(self.scores.gains(chosen)[candidate])
        return (
            self._sound(candidate, gain, chosen, false_alarm)
            and self.scores.held_out(candidate, chosen) > BORNE_OUT
            and self._no_chance(candidate, gain * self.scores.surely(candidate, chosen), false_alarm)
        )

    def recurs(self, candidate: int, chosen: list[int]) -> bool:
        """Whether what a cause explains is there with angles that have other errors."""
        return self.recurring(candidate, chosen) > 1.0

    def recurring(self, candidate: int, chosen: list[int]) -> float:
        """Of what a cause explains, the share that is there with angles that have other errors, in multiples of what
        must be."""
        dry = self.scores.hypothesis(candidate).effect.dry
        return self.scores.recurring(candidate, chosen) / (_SLOWLY if dry else RECURRING)

    def _sound(self, candidate: int, gain: float, chosen: list[int], false_alarm: float = FALSE_ALARM) -> bool:
        beyond_chance = self._no_chance(candidate, gain, false_alarm)
        return beyond_chance and self._matters(candidate, chosen) and self._apart(candidate, chosen)

    def _no_chance(self, candidate: int, gain: float, false_alarm: float) -> bool:
        return self.scores.chance.excluded(candidate, gain, false_alarm)

    def stands_out(self, candidate: int, chosen: list[int]) -> bool:
        """Whether a line stands out of the spectrum that is left beside it and all that are ``chosen``, whose lines
        explain by chance as much as half of them do: pushes at few places are periodic at all orders, and at none."""
        gain = float(self.scores.gains(chosen)[candidate])
        lines = self.scores.owner == self.scores.owner[candidate]
        left = self.scores.gains([*chosen, candidate])[lines]
        left = left[np.isfinite(left)]
        if len(left) < _A_SPECTRUM:
            return True
        # Half of what chance gives a line of two coefficients is below the logarithm of two.
        level = max(float(np.median(left)) / np.log(2.0), 1.0)
        return bool(gain > level * np.log(len(left) / _AMONG_LINES))

    def one_sided(self, chosen: list[int]) -> int | None:
        """The best supported candidate that all would admit but the rows left out: what it explains is there, and
        shows in one part of the motions alone, so that its name is not borne out. None where there is none."""
        for candidate, gain, supported in self.scores.ranked(chosen)[:_TRIED]:
            if (
                supported > 0.0
                and self._sound(candidate, gain, chosen)
                and float(self.scores.explained([candidate], chosen).max()) > LEAST_SEEN
                and self.scores.held_out(candidate, chosen) <= BORNE_OUT
                and self.recurs(candidate, chosen)
            ):
                return candidate
        return None

    def _apart(self, candidate: int, chosen: list[int]) -> bool:
        """Whether these data can tell a candidate from those already chosen, and all of them keep their limits."""
        if any(self.scores.alike(candidate, k, _TOLD_APART) or self._excluded(candidate, k) for k in chosen):
            return False
        return not self.beyond_limits([*chosen, candidate], slack=2.0) and not self.read_otherwise(candidate, chosen)

    def _excluded(self, candidate: int, chosen: int) -> bool:
        """Whether what was chosen leaves no room for a candidate."""
        return self.contained(candidate, chosen) or self._elsewhere(candidate, chosen)

    def _elsewhere(self, candidate: int, chosen: int) -> bool:
        """Whether it is what was chosen in another channel of the same equation, which shows the difference of the two
        alone: how late one is against the other."""
        own, other = (self.scores.hypothesis(k) for k in (candidate, chosen))
        return (
            own.effect.name == other.effect.name
            and own.place != other.place
            and (own.place.joint, own.place.other) == (other.place.joint, other.place.other)
            and own.effect.rows(self.design.body, own.place) == other.effect.rows(self.design.body, other.place)
            and own.effect.equation_at(own.place) == other.effect.equation_at(other.place)
        )

    def contained(self, candidate: int, chosen: int) -> bool:
        """Whether a candidate is a special case of what was chosen there: it could only mend that one's shape."""
        own, other = (self.scores.hypothesis(k) for k in (candidate, chosen))
        within = own.place == other.place and own.effect.name in other.effect.contains
        return within and own.effect.plain(self.design.candidates[candidate].theta)

    def read_otherwise(self, candidate: int, chosen: Sequence[int]) -> bool:
        """Whether a candidate stands for an offset that was read with the drives off: a spring whose centre is far
        away, or a line as slow. It is no better supported than the offset would be that motions alone tell."""
        own = self.scores.hypothesis(candidate)
        alike = {*own.effect.contains, *own.effect.looks_like}
        if self.design.reading is None or own.effect.read_off or own.place.joint is None:
            return False
        for k, other in enumerate(self.design.candidates):
            law = self.design.hypotheses[other.hypothesis]
            if law.effect.read_off and law.effect.name in alike and law.place == own.place and k not in chosen:
                supported = float(self.scores.gains(chosen)[candidate]) - self.scores.penalty([candidate])
                return supported <= self._supported_unread(k, own.place.joint, self.design.reading, chosen)
        return False

    def _supported_unread(self, offset: int, joint: int, reading: OffReading, chosen: Sequence[int]) -> float:
        """Support of a joint's offset beside those that were chosen, by the motions alone."""
        own = self.design.candidates[offset]
        told, score, _ = self.scores.model(chosen).left_of(own.columns)
        read = float(self.scores.weights[list(own.channels)].sum()) / reading.error[joint] ** 2
        energy = float(told[0, 0]) - read
        if energy <= 0.0:
            return -np.inf
        product = float(score[0]) - read * float(reading.offset[joint])
        return float(0.5 * product**2 / energy - self.scores.penalty([offset]))

    def beyond_limits(self, chosen: list[int], slack: float) -> list[int]:
        """Candidates of which a coefficient is beyond its limits by more than ``slack`` standard errors."""
        model = self.scores.model(chosen)
        value, error = np.zeros(self.design.size), np.zeros(self.design.size)
        value[model.active], error[model.active] = model.value, slack * np.sqrt(np.diag(model.covariance))
        result = []
        for k in chosen:
            own = self.design.candidates[k]
            low, high = value[own.columns] - own.lower, own.upper - value[own.columns]
            if np.any(np.minimum(low, high) < -error[own.columns]):
                result.append(k)
        return result

    def _matters(self, candidate: int, chosen: list[int]) -> bool:
        """Whether a candidate explains more than a trifle of what is left to explain in one of its channels."""
        left = np.maximum(self.scores.model(chosen).squares() / self.scores.total.rows - 1.0, 0.0)
        channels = list(self.design.candidates[candidate].channels)
        return bool(np.any(self.scores.explained([candidate], chosen)[channels] > _LEAST_SHARE * left[channels]))

    def told(self, candidate: int, chosen: list[int], misfit: Array, forms: Sequence[int] = ()) -> float:
        """What a cause explains, with all of its recurrences, in multiples of a trifle, where the chosen stand beside
        ``forms`` of some; ``misfit`` (channels,) what they leave to be seen, of the noise's variance."""
        rows = self.scores.total.rows
        before, after = (self.scores.model(k).squares() / rows for k in ([], [*chosen, *forms]))
        explainable = np.maximum(before - np.minimum(after, 1.0), 0.0)
        left = np.maximum(_REST * (after - 1.0 - self.scores.noise_error), _SEEN * misfit)
        trifle = np.minimum(
            self._share_of(explainable, candidate, chosen, forms),
            np.maximum(left, 1.0 if self.scores.assumed else 0.0),
        )
        own = [c for c in chosen if self.scores.owner[c] == self.scores.owner[candidate]]
        lost = self.scores.explained(own, [c for c in (*chosen, *forms) if c not in own])
        channels = list(self.design.candidates[candidate].channels)
        return float(np.max((lost / np.maximum(trifle, self._least(candidate, chosen)))[channels]))

    def _least(self, candidate: int, chosen: list[int]) -> Array:
        """(channels,) of the noise's variance, what a cause must explain beside those that are chosen, if they fit ever
        so well."""
        dry = [k for k in chosen if self.scores.hypothesis(k).effect.dry]
        if not dry or self._rubs(candidate):
            return np.full(len(self.design.channels), LEAST_SEEN)
        friction = self.scores.explained(dry, [k for k in chosen if k not in dry])
        return np.asarray(np.maximum(LEAST_SEEN, _OF_DRY_FRICTION * friction))

    def _share_of(self, explainable: Array, candidate: int, chosen: list[int], forms: Sequence[int]) -> Array:
        """(channels,) of the ``explainable``, what is too little for a cause to be told. Of what frictions explain that
        stand beside ``forms``, it is for causes of another kind no more than what those are exact to."""
        places = {self.scores.hypothesis(k).place for k in forms}
        rubbing = [k for k in chosen if self._rubs(k) and self.scores.hypothesis(k).place in places]
        if not rubbing or self._rubs(candidate):
            return np.asarray(_LEAST_SHARE * explainable)
        others = [k for k in chosen if k not in rubbing]
        friction = np.clip(self.scores.explained(rubbing, others), 0.0, explainable)
        return np.asarray(_LEAST_SHARE * (explainable - friction) + OF_FRICTION * friction)

    def _rubs(self, candidate: int) -> bool:
        effect = self.scores.hypothesis(candidate).effect
        return effect.dry or effect.name == "viscous_friction"
