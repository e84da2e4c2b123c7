"""The evidence about one design: how well any set of its candidates explains the recordings, and what it costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.borne_out import BORNE_OUT, predicting
from estimator.diagnosis.evidence.chance import Chance, drawn_noise
from estimator.diagnosis.evidence.conditional import Conditional, groups_of, within_limits
from estimator.diagnosis.evidence.design import Design, Hypothesis
from estimator.diagnosis.evidence.exchange import Exchange
from estimator.diagnosis.evidence.folds import Folds
from estimator.diagnosis.evidence.grams import Block, Sheet, total, total_anew
from estimator.diagnosis.evidence.maps import Map
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]

_RIDGE = 1e-9
"""Of a column's energy: columns that tell the same share it."""
_OF_ITSELF = 0.5
"""Of what a candidate explains, what must be there of itself with angles that have other errors for these to tell."""
_LEAST_EXCHANGED = 0.1
"""Of what a candidate explains, how much must lie where motions recur for them to tell."""
_ROUGHLY = 0.5
"""Of the evidence that a tolerance gives, what stays when it is wider by the square root of two."""
_MODELS = 16
"""That are remembered: one question after the other is about much the same causes."""
_SAME_ORDER = 0.5
"""Where an effect recurs at a place, what each of its columns must leave: the next line of a spectrum is the same."""


class Scores:
    """Of candidates and sets of them, at the present weights of the channels; worked out once, and remembered."""

    def __init__(
        self,
        design: Design,
        blocks: Sequence[Block | Sheet],
        folds: Folds,
        news: Array | None = None,
        exchanges: Sequence[Exchange] = (),
        freedom: float = np.inf,
    ) -> None:
        """``folds`` says for each block what it is left out with; ``news`` (channels,) how much of what
        independent rows would tell these do (`Noise.news`), all of it where none is given; ``exchanges`` the torques
        beside angles that have other errors; ``freedom`` the degrees of freedom behind the noise's variances, none
        where it is assumed for want of playings."""
        self.design, self.assumed = design, freedom == 0.0
        self.total = total(blocks)
        self.noise_error = float(np.sqrt(2.0 / self.total.rows + 2.0 / (freedom or np.inf)))
        """Relative standard error of a residual's mean square beside the noise's variance."""
        self.groups = groups_of(design)
        self.owner = np.array([candidate.hypothesis for candidate in design.candidates])
        self.is_map = np.array([isinstance(hypothesis.effect, Map) for hypothesis in design.hypotheses])
        self._news = np.ones(len(design.channels)) if news is None else news
        self.weights = self._news.copy()
        self._blocks, self._folds, self._exchanges = blocks, folds, exchanges
        self._exchanged: dict[tuple[int, ...], list[Block]] = {}
        self._sizes: dict[int, int] = {}
        self._penalties = np.array([self.penalty([k]) for k in range(len(design.candidates))])
        self._widths = np.array([len(candidate.columns) for candidate in design.candidates])
        self._forget()
        self._plain = self.model([])
        self._chance: Chance | None = None
        self._noise = drawn_noise(self._plain)

    def known_to(self, precision: Array) -> Scores:
        """The same of a design that differs in its precision alone: what chance makes of it depends on the links."""
        other = copy(self)
        other.design = self.design.believed(precision)
        other.weights = self._news.copy()
        other._forget()
        rank = self.design.base.rank
        if not np.array_equal(precision[:rank, :rank], self.design.precision[:rank, :rank]):
            other._plain = other.model([])
            other._chance = Chance(other._plain, self._noise, self.chance)
        return other

    @property
    def chance(self) -> Chance:
        """What chance makes of the given model, at the weights that the noise gives; worked out when it is asked."""
        if self._chance is None:
            self._chance = Chance(self._plain, self._noise)
        return self._chance

    def sharper(self, design: Design, blocks: Sequence[Block | Sheet]) -> Scores:
        """The same of a design that differs in the shapes of some candidates alone: chance knows these no better."""
        other, pairs = copy(self), zip(self.design.candidates, design.candidates, strict=True)
        others = [new.columns for old, new in pairs if not np.array_equal(old.theta, new.theta)]
        columns = np.concatenate([np.zeros(0, dtype=np.intp), *others])
        changed = [places[places >= 0] for places in design.position[:, columns]]
        other.design, other.total, other._blocks = design, total_anew(self.total, blocks, changed), blocks
        other.weights = self._news.copy()
        other._exchanged = {}
        other._forget()
        return other

    def _forget(self) -> None:
        """At other weights nothing that was worked out holds any longer."""
        self._nats: dict[frozenset[int], float] = {}
        self._gains: dict[frozenset[int], Array] = {}
        self._held_out: dict[tuple[int, frozenset[int]], tuple[float, float]] = {}
        self._recurring: dict[tuple[int, frozenset[int]], float] = {}
        self._resemblance: dict[tuple[int, int], Array] = {}
        self._own: list[Array] | None = None
        self._models: dict[tuple[int, ...], Conditional] = {}
        self._told = Weighted(self.design, self.total, self.weights)

    def model(self, chosen: Sequence[int]) -> Conditional:
        """The given model with these candidates, fitted at the present weights. A part of a law that would have the
        wrong sign is not there; a law that has it as a whole keeps it, and is refused for that."""
        key = tuple(chosen)
        if key not in self._models:
            if len(self._models) == _MODELS:
                del self._models[next(iter(self._models))]
            self._models[key] = within_limits(self._told, [self.design.candidates[k] for k in chosen], least=1)
        return self._models[key]

    def excess(self, chosen: Sequence[int]) -> Array:
        """(channels,) mean square of the whitened residual: one where only noise is left."""
        model = self.model(chosen)
        return model.squares() / max(1.0, self.total.rows - len(model.active) / len(self.design.channels))

    def reweigh(self, chosen: Sequence[int]) -> None:
        """What is not explained counts as noise: a channel weighs the less the worse it is understood."""
        self.weights = self._news / np.maximum(1.0, self.excess(chosen))
        self._forget()

    def size(self, candidate: int) -> int:
        """Physical parameters of a candidate: what only shapes its columns, such as the width of a sign, is no freedom
        that could stand for another cause."""
        if candidate not in self._sizes:
            self._sizes[candidate] = self._physical(candidate)
        return self._sizes[candidate]

    def _physical(self, candidate: int) -> int:
        own = self.design.candidates[candidate]
        if self.is_map[own.hypothesis]:
            return len(own.columns)
        neutral = self.design.hypotheses[own.hypothesis]
        effect, free = neutral.effect, len(own.theta) - len(neutral.effect.choices)
        told = effect.parameters(neutral.place, own.theta, np.ones(len(own.columns)))
        enter = np.zeros(len(own.columns), dtype=bool)
        for channel in own.channels:
            enter |= np.diag(self.total.grams[channel])[self.design.position[channel][own.columns]] > 0.0
        numbers = sum(np.size(value) for value in told.values()) - effect.redundant(own.theta)
        return min(int(enter.sum()) + free, numbers) - len(effect.forms)

    def penalty(self, chosen: Sequence[int]) -> float:
        """Nats that a model's freedom costs (Bayesian information criterion)."""
        unknowns = sum(self.size(k) for k in chosen)
        return float(0.5 * np.log(self.total.rows) * unknowns)

    def support(self, chosen: Sequence[int]) -> float:
        """Log-likelihood of a model above the given one's, less its penalty."""
        return self.nats(chosen) - self.penalty(chosen)

    def nats(self, chosen: Sequence[int]) -> float:
        """Log-likelihood of a model above the given one's, up to a constant."""
        key = frozenset(chosen)
        if key not in self._nats:
            self._nats[key] = self.model(chosen).explained
        return self._nats[key]

    def nats_there(self, candidate: int, chosen: Sequence[int]) -> float:
        """Of a model, what all of the chosen explain together that are of a candidate's place."""
        place = self.hypothesis(candidate).place
        return self.nats(chosen) - self.nats([k for k in chosen if self.hypothesis(k).place != place])

    def explained(self, causes: Sequence[int], others: Sequence[int]) -> Array:
        """(channels,) of the noise's variance, what ``causes`` explain beside ``others``: in residual, and in what the
        given model would have to leave its tolerance in their stead, told of the channels that they enter."""
        both, weights = [*others, *causes], self.weights
        less = (self.model(others).squares() - self.model(both).squares()) / self.total.rows
        gain = self.nats(both) - self.nats(others)
        bent = max(2.0 * gain / self.total.rows - float(weights @ less), 0.0)
        channels = sorted({channel for k in causes for channel in self.design.candidates[k].channels})
        less[channels] += bent / float(weights[channels].sum())
        return np.asarray(less)

    def gains(self, chosen: Sequence[int]) -> Array:
        """(candidates,) log-likelihood that each candidate would add."""
        key = frozenset(chosen)
        if key not in self._gains:
            if self._own is None:
                self._own = [self._told.of_each(group.columns) for group in self.groups]
            self._gains[key] = self.model(chosen).gains(self.groups, self._own)
        return self._gains[key]

    def gains_of(self, few: Sequence[int], chosen: Sequence[int]) -> Array:
        """(candidates,) likewise, of a few candidates; others −inf, or as `gains` where these are known already."""
        key = frozenset(chosen)
        return self._gains[key] if key in self._gains else self.model(chosen).gains_of_few(groups_of(self.design, few))

    def ranked(self, chosen: Sequence[int]) -> list[tuple[int, float, float]]:
        """Best supported candidate of every other effect, its gain and its gain less penalty, best first."""
        gains = self.gains(chosen)
        taken = [int(self.owner[k]) for k in chosen if not self.recurs(k)]
        open_to = np.isfinite(gains) & ~self.is_map[self.owner] & ~np.isin(self.owner, taken)
        # Of laws that are the same here, the one that has no more elsewhere: a rotor, before the first link's inertia.
        order = np.lexsort((self._widths, np.round(self._penalties - gains, 6)))
        again = {int(self.owner[k]): [c for c in chosen if self.owner[c] == self.owner[k]] for k in chosen}
        best: dict[int, int] = {}
        for k in map(int, order[open_to[order]]):
            own = int(self.owner[k])
            if own not in best and not any(self.alike(k, c, _SAME_ORDER) for c in again.get(own, ())):
                best[own] = k
        rows = [(k, float(gains[k]), float(gains[k] - self._penalties[k])) for k in best.values()]
        return sorted(rows, key=lambda row: -row[2])

    def held_out(self, candidate: int, others: Sequence[int]) -> float:
        """Log-likelihood that a candidate adds to the prediction of each fold from all others, summed, in standard
        errors over the folds: with the given model as the others bend it, or afresh within its tolerance, whichever
        tells more."""
        return max(self._predicting(candidate, others))

    def surely(self, candidate: int, others: Sequence[int]) -> float:
        """Of the log-likelihood that a candidate adds, the share that is sure: half, where the given model bent by the
        rows that stay predicts as well. What tells against it then is its tolerance, which is known roughly."""
        bent, afresh = self._predicting(candidate, others)
        return _ROUGHLY if bent < min(afresh, BORNE_OUT) else 1.0

    def _predicting(self, candidate: int, others: Sequence[int]) -> tuple[float, float]:
        key = (candidate, frozenset(others))
        if key not in self._held_out:
            self._held_out[key] = predicting(self.design, self._blocks, self._folds, self.weights, others, candidate)
        return self._held_out[key]

    def recurring(self, candidate: int, others: Sequence[int]) -> float:
        """How much of what a candidate explains beside others is there still when torques are put beside angles that
        have other errors (`exchange`), of what is there of itself, by the way that leaves least: one is all of it. One
        too where none tells."""
        key = (candidate, frozenset(others))
        if key not in self._recurring:
            self._recurring[key] = min(self._shares_exchanged(candidate, others), default=1.0)
        return self._recurring[key]

    def _shares_exchanged(self, candidate: int, others: Sequence[int]) -> Iterator[float]:
        exchanges = [exchange for exchange in self._exchanges if exchange.pieces]
        if not exchanges:
            return
        matrix, score, energy = self.model(others).left_of(self.design.candidates[candidate].columns)
        # A map has columns where no motion comes: these stay zero.
        scale = 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0))
        normal = matrix * np.outer(scale, scale) + _RIDGE * np.eye(len(scale)) + np.diag(energy <= 0.0)
        value = scale * np.linalg.solve(normal, scale * score)
        chosen = sorted({*others, candidate})
        part = self.design.with_candidates([self.design.candidates[k] for k in chosen])
        if tuple(chosen) not in self._exchanged:
            self._exchanged[tuple(chosen)] = [exchange.among(part) for exchange in exchanges]
        columns = part.candidates[chosen.index(candidate)].columns
        rest = np.setdiff1d(np.arange(part.size), columns)
        for exchange, block in zip(exchanges, self._exchanged[tuple(chosen)], strict=True):
            there, told, _ = Conditional(Weighted(part, block, self.weights), rest).left_of(columns)
            whole = float(value @ there @ value)
            least = _LEAST_EXCHANGED * float(value @ matrix @ value)
            if whole <= least:
                yield exchange.untold
                continue
            share = float(value @ told) / whole
            if exchange.of_a_part and share < 1.0:
                itself = exchange.within(part, part.candidates[chosen.index(candidate)], value)
                _, told, _ = Conditional(Weighted(part, itself, self.weights), rest).left_of(columns)
                share /= float(np.clip(value @ told / whole, _OF_ITSELF, 1.0))
            yield share

    def hypothesis(self, candidate: int) -> Hypothesis:
        """What a candidate is a form of."""
        return self.design.hypotheses[self.design.candidates[candidate].hypothesis]

    def recurs(self, candidate: int) -> bool:
        """Whether its place can have the effect more than once."""
        return bool(self.design.hypotheses[self.owner[candidate]].effect.recurs)

    def alike(self, one: int, other: int, least: float) -> bool:
        """Whether the other leaves less than this share of each column of the one in these data: then one can only
        undo the other."""
        return bool(np.all(self.resemblance(one, other) > 1.0 - least))

    def resemblance(self, one: int, other: int) -> Array:
        """Of the energy of each column of the one that has any, what the other's columns explain."""
        if (one, other) not in self._resemblance:
            self._resemblance[one, other] = self._explained_share(one, other)
        return self._resemblance[one, other]

    def _explained_share(self, one: int, other: int) -> Array:
        first, second = self.design.candidates[one].columns, self.design.candidates[other].columns
        both = np.concatenate([first, second])
        squares = self._told.products(both, both)
        cross, others = squares[: len(first), len(first) :], squares[len(first) :, len(first) :]
        explained = np.einsum("ab,ab->a", cross @ np.linalg.pinv(others), cross)
        energy = np.diag(squares)[: len(first)]
        told = energy > 0.0
        return np.asarray(explained[told] / energy[told])
