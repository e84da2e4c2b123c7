"""Forward selection of causes, with every earlier choice judged again after each step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.chance import Chance, resample
from estimator.diagnosis.conditional import Conditional, groups_of
from estimator.diagnosis.design import Candidate, Design
from estimator.diagnosis.grams import Block, less, total
from estimator.diagnosis.maps import Map

Array = NDArray[np.float64]

FALSE_ALARM = 0.02
"""Family-wise probability of a false alarm that a step may have."""
_LEAST_SHARE = 0.04
"""Of the explainable that is left in its channels, what a cause must explain."""
_HELD_OUT = 1.64
"""Standard errors by which the held-out gain must be above zero."""
_TOLD_APART = 0.01
"""Of a candidate's columns' energy, what each cause already chosen must leave: a canonical correlation of 0.995."""
_MOST_CAUSES_A_JOINT = 3
_SAME_ORDER = 0.5
"""Where an effect recurs at a place, what each of its columns must leave: the next line of a spectrum is the same."""
_TRIED = 4
"""Hypotheses that a step tries before it gives up."""


@dataclass(frozen=True)
class Alternative:
    """A candidate that could stand in for a cause, and how many nats behind it is."""

    candidate: int
    gap: float


@dataclass(frozen=True)
class Cause:
    """A candidate that was chosen, with its evidence given all others that were."""

    candidate: int
    gain: float
    """Log-likelihood that is lost without it."""
    false_alarm: float
    held_out: float
    """Log-likelihood gained on blocks left out, in standard errors."""
    alternatives: tuple[Alternative, ...] = ()


class Search:
    """The evidence about one design; `Search.run` finds the causes."""

    def __init__(self, design: Design, blocks: Sequence[Block], folds: Sequence[int]) -> None:
        """``folds`` says for each block which fold it is left out with."""
        self.design, self.blocks = design, list(blocks)
        self.total = total(blocks)
        self.folds = np.array(folds)
        self.groups = groups_of(design)
        self.owner = np.array([candidate.hypothesis for candidate in design.candidates])
        self.is_map = np.array([isinstance(hypothesis.effect, Map) for hypothesis in design.hypotheses])
        self.weights = np.ones(len(design.channels))
        self._training: dict[int, Block] = {}
        self._sizes: dict[int, int] = {}
        self._forget()
        self.chance: Chance = resample(self.model([]), self.groups)

    def _forget(self) -> None:
        """At other weights nothing that was worked out holds any longer."""
        self._supports: dict[frozenset[int], float] = {}
        self._gains: dict[frozenset[int], Array] = {}
        self._held_out: dict[tuple[int, frozenset[int]], float] = {}

    def model(self, chosen: Sequence[int], block: Block | None = None) -> Conditional:
        """The given model with these candidates, fitted at the present weights."""
        columns = [self.design.candidates[k].columns for k in chosen]
        active = np.concatenate([np.arange(self.design.given), *columns]).astype(np.intp)
        return Conditional(self.design, block or self.total, self.weights, active)

    def excess(self, chosen: Sequence[int]) -> Array:
        """(channels,) mean square of the whitened residual: one where only noise is left."""
        model = self.model(chosen)
        return model.squares() / max(1.0, self.total.rows - len(model.active) / len(self.design.channels))

    def reweigh(self, chosen: Sequence[int]) -> None:
        """What is not explained counts as noise: a channel weighs the less the worse it is understood."""
        self.weights = 1.0 / np.maximum(1.0, self.excess(chosen))
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
        told = neutral.effect.parameters(neutral.place, own.theta, np.ones(len(own.columns)))
        return min(len(own.columns) + len(own.theta), sum(np.size(value) for value in told.values()))

    def penalty(self, chosen: Sequence[int]) -> float:
        """Nats that a model's freedom costs (Bayesian information criterion)."""
        unknowns = sum(self.size(k) for k in chosen)
        return float(0.5 * np.log(self.total.rows) * unknowns)

    def support(self, chosen: Sequence[int]) -> float:
        """Log-likelihood of a model above the given one's, less its penalty."""
        key = frozenset(chosen)
        if key not in self._supports:
            model = self.model(chosen)
            explained = float(0.5 * (model.right[model.active] @ model.value))
            self._supports[key] = explained - self.penalty(chosen)
        return self._supports[key]

    def gains(self, chosen: Sequence[int]) -> Array:
        """(candidates,) log-likelihood that each candidate would add."""
        key = frozenset(chosen)
        if key not in self._gains:
            self._gains[key] = self.model(chosen).gains(self.groups)[0]
        return self._gains[key]

    def ranked(self, chosen: Sequence[int], maps: bool = False) -> list[tuple[int, float, float]]:
        """Best candidate of every other effect (or of every map), its gain and its gain less penalty, best first."""
        gains = self.gains(chosen)
        taken = {self.owner[k] for k in chosen if not self.recurs(k)}
        best: dict[int, int] = {}
        for k in np.argsort(-gains):
            if self.owner[k] not in taken and self.is_map[self.owner[k]] == maps and np.isfinite(gains[k]):
                if any(self.owner[k] == self.owner[c] and self._alike(int(k), c, _SAME_ORDER) for c in chosen):
                    continue
                best.setdefault(int(self.owner[k]), int(k))
        rows = [(k, float(gains[k]), float(gains[k]) - self.penalty([k])) for k in best.values()]
        return sorted(rows, key=lambda row: -row[2])

    def run(self) -> list[Cause]:
        """All causes, the one with most evidence first."""
        chosen: list[int] = []
        self.reweigh(chosen)
        limit = _MOST_CAUSES_A_JOINT * self.design.body.n
        # A cause that is put in another's place, or taken out again, must not come back for ever.
        seen = {frozenset(chosen)}
        while len({self.owner[k] for k in chosen}) < limit:
            grown = next((g for g in self._steps(chosen) if frozenset(g) not in seen), None)
            if grown is None:
                break
            chosen = grown
            seen.add(frozenset(chosen))
            self.reweigh(chosen)
        chosen = self._pruned(self._swapped(chosen))
        return sorted((self._judged(k, chosen) for k in chosen), key=lambda cause: -cause.gain)

    def held_out(self, candidate: int, others: Sequence[int]) -> float:
        """Log-likelihood that a candidate gains on data left out, in its standard errors over the blocks."""
        key = (candidate, frozenset(others))
        if key not in self._held_out:
            self._held_out[key] = self._gain_left_out(candidate, others)
        return self._held_out[key]

    def _gain_left_out(self, candidate: int, others: Sequence[int]) -> float:
        gains = np.empty(len(self.blocks))
        for fold in np.unique(self.folds):
            train = self._without(int(fold))
            lean, full = self.model(others, train), self.model([*others, candidate], train)
            for k in np.flatnonzero(self.folds == fold):
                before = lean.squares_with(lean.active, lean.value, self.blocks[k])
                after = full.squares_with(full.active, full.value, self.blocks[k])
                gains[k] = 0.5 * float(self.weights @ (before - after))
        error = float(gains.std(ddof=1) * np.sqrt(len(gains)))
        return float(gains.sum()) / max(error, 1e-12)

    def _without(self, fold: int) -> Block:
        if fold not in self._training:
            out = [block for block, f in zip(self.blocks, self.folds, strict=True) if f == fold]
            self._training[fold] = less(self.total, out)
        return self._training[fold]

    def _steps(self, chosen: list[int]) -> Iterator[list[int]]:
        """What the model may become by one more cause, the best supported first; nothing when none is supported."""
        for candidate, gain, supported in self.ranked(chosen)[:_TRIED]:
            if supported <= 0.0:
                return
            # The dearest question last: a fit to each fold.
            if (
                self.chance.false_alarm(int(self.owner[candidate]), gain) <= FALSE_ALARM
                and self._matters(candidate, chosen)
                and self._apart(candidate, chosen)
                and self.held_out(candidate, chosen) > _HELD_OUT
            ):
                grown = [*chosen, candidate]
                yield self._pruned(self._merged(self._simplified(grown), self._joint(candidate)))

    def _apart(self, candidate: int, chosen: list[int]) -> bool:
        """Whether these data can tell a candidate from those already chosen, and all of them keep their limits."""
        if any(self._alike(candidate, k, _TOLD_APART) or self._contained(candidate, k) for k in chosen):
            return False
        return not self._beyond_limits([*chosen, candidate], slack=2.0)

    def recurs(self, candidate: int) -> bool:
        """Whether its place can have the effect more than once."""
        return bool(self.design.hypotheses[self.owner[candidate]].effect.recurs)

    def _contained(self, candidate: int, chosen: int) -> bool:
        """Whether a candidate is a special case of what was chosen there: it could only mend that one's shape."""
        own, other = (self.design.hypotheses[self.owner[k]] for k in (candidate, chosen))
        return own.place == other.place and own.effect.name in other.effect.contains

    def _beyond_limits(self, chosen: list[int], slack: float) -> list[int]:
        """Candidates of which a coefficient is beyond its limits by more than ``slack`` standard errors."""
        model, place = self.model(chosen), self.design.given
        result = []
        for k in chosen:
            own = self.design.candidates[k]
            span = slice(place, place + len(own.columns))
            value, error = model.value[span], slack * np.sqrt(np.diag(model.covariance)[span])
            if np.any(value < own.lower - error) or np.any(value > own.upper + error):
                result.append(k)
            place = span.stop
        return result

    def _alike(self, one: int, other: int, least: float) -> bool:
        """Whether the other leaves less than this share of each column of the one in these data: then one can only
        undo the other."""
        first, second = self.design.candidates[one].columns, self.design.candidates[other].columns
        products = np.zeros((len(first) + len(second),) * 2)
        for channel, gram in enumerate(self.total.grams):
            place = self.design.position[channel][np.concatenate([first, second])]
            enters = np.flatnonzero(place >= 0)
            own = place[enters]
            products[enters[:, None], enters] += self.weights[channel] * gram[own[:, None], own]
        cross, others = products[: len(first), len(first) :], products[len(first) :, len(first) :]
        explained = np.einsum("ab,ab->a", cross @ np.linalg.pinv(others), cross)
        energy = np.diag(products)[: len(first)]
        told = energy > 0.0
        return bool(np.all(explained[told] > (1.0 - least) * energy[told]))

    def _matters(self, candidate: int, chosen: list[int]) -> bool:
        """Whether a candidate explains more than a trifle of what is left to explain in one of its channels."""
        rows = self.total.rows
        before, after = self.model(chosen).squares() / rows, self.model([*chosen, candidate]).squares() / rows
        left = np.maximum(before - 1.0, 0.0)
        channels = list(self.design.candidates[candidate].channels)
        return bool(np.any((before - after)[channels] > _LEAST_SHARE * left[channels]))

    def _simplified(self, chosen: list[int]) -> list[int]:
        """Replaces an effect by special cases of it when they are as well supported."""
        for k in chosen:
            candidate = self.design.candidates[k]
            hypothesis = self.design.hypotheses[candidate.hypothesis]
            if not hypothesis.effect.contains:
                continue
            others = [c for c in chosen if c != k]
            parts = [self._best_of(name, candidate, others) for name in hypothesis.effect.contains]
            parts = [part for part in parts if part is not None and part not in others]
            best, support = chosen, self.support(chosen)
            for count in range(1, len(parts) + 1):
                for subset in combinations([p for p in parts if p is not None], count):
                    trial = [*others, *subset]
                    if (value := self.support(trial)) > support:
                        best, support = trial, value
            chosen = best
        return chosen

    def _best_of(self, name: str, candidate: Candidate, others: Sequence[int]) -> int | None:
        """The candidate of the named effect at the same place that adds most to the others."""
        place = self.design.hypotheses[candidate.hypothesis].place
        same = [
            k
            for k, other in enumerate(self.design.candidates)
            if (h := self.design.hypotheses[other.hypothesis]).effect.name == name and h.place == place
        ]
        gains = self.gains(others)
        return max(same, key=lambda k: gains[k] - self.penalty([k]), default=None)

    def _merged(self, chosen: list[int], joint: int | None) -> list[int]:
        """One effect in place of several at this joint, where that is better supported."""
        at = [k for k in chosen if joint is not None and self._joint(k) == joint and not self.recurs(k)]
        best, support = chosen, self.support(chosen)
        for count in range(2, len(at) + 1):
            for leaving in combinations(at, count):
                others = [k for k in chosen if k not in leaving]
                for candidate, _, _ in [row for row in self.ranked(others) if self._joint(row[0]) == joint][:3]:
                    trial = [*others, candidate]
                    if (value := self.support(trial)) > support:
                        best, support = trial, value
        return best

    def _joint(self, candidate: int) -> int | None:
        return self.design.hypotheses[self.design.candidates[candidate].hypothesis].place.joint

    def _pruned(self, chosen: list[int]) -> list[int]:
        """Without causes that the others have made superfluous or impossible, the least supported first."""
        while wrong := self._beyond_limits(chosen, slack=1.0):
            chosen = [c for c in chosen if c != wrong[0]]
        while len(chosen) > 1:
            whole = self.support(chosen)
            loss = {k: whole - self.support([c for c in chosen if c != k]) for k in chosen}
            weakest = min(loss, key=lambda k: loss[k])
            if loss[weakest] > 0.0:
                break
            chosen = [c for c in chosen if c != weakest]
        return chosen

    def _swapped(self, chosen: list[int]) -> list[int]:
        """Each cause against all that could stand in its place."""
        for _ in range(2):
            before = list(chosen)
            for k in before:
                if k not in chosen:
                    continue
                others = [c for c in chosen if c != k]
                rivals = [row for row in self.ranked(others)[:3] if row[0] not in chosen]
                best = max((row[0] for row in rivals), key=lambda c: self.support([*others, c]), default=k)
                if self.support([*others, best]) > self.support([*others, k]):
                    chosen = self._simplified([*others, best])
            if set(before) == set(chosen):
                break
        return chosen

    def _judged(self, candidate: int, chosen: list[int]) -> Cause:
        others = [c for c in chosen if c != candidate]
        own = self.owner[candidate]
        rows = self.ranked(others)
        mine = next((row for row in rows if self.owner[row[0]] == own), None)
        gain = mine[1] if mine is not None else 0.0
        supported = mine[2] if mine is not None else 0.0
        alternatives = tuple(Alternative(k, supported - value) for k, _, value in rows if self.owner[k] != own)
        cause = Cause(candidate, gain, self.chance.false_alarm(int(own), gain), self.held_out(candidate, others))
        return replace(cause, alternatives=alternatives)
