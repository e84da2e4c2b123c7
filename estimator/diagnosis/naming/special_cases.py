"""Special cases of laws: what a wider law contains, in its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from estimator.diagnosis.evidence.design import Candidate
from estimator.diagnosis.naming.admission import Admission
from estimator.effects import Law


def _made_of(effect: Law) -> Iterator[tuple[str, ...]]:
    """The names of effects that could stand for one together: some that it contains, alone or with what it is made
    with."""
    names = effect.contains
    for count in range(1, len(names) + 1):
        for some in combinations(names, count):
            yield some
            yield from ((*some, other) for other in effect.made_with)


class SpecialCases:
    """Finds them under the scores of one admission."""

    def __init__(self, admission: Admission) -> None:
        self.admission, self.scores, self.design = admission, admission.scores, admission.scores.design

    def simplified(self, chosen: list[int]) -> list[int]:
        """Replaces an effect by special cases of it, or by what it can be made with, when they are as well
        supported."""
        for k in chosen:
            trial = self.of(k, chosen)
            if trial and self.scores.support(trial) > self.scores.support(chosen):
                chosen = trial
        return chosen

    def of(self, candidate: int, chosen: list[int]) -> list[int]:
        """The best supported special cases in the place of a cause, beside the others that were ``chosen``; empty where
        there are none. Friction that falls as the speed rises is none that is dry and viscous, whose slope would be
        negative."""
        hypothesis, others = self.scores.hypothesis(candidate), [c for c in chosen if c != candidate]
        made = (self._parts(some, self.design.candidates[candidate], others) for some in _made_of(hypothesis.effect))
        ranked = sorted(([*others, *parts] for parts in made if parts), key=self.scores.support, reverse=True)
        return next((trial for trial in ranked if set(trial[len(others) :]).isdisjoint(self.beyond(trial))), [])

    def beyond(self, chosen: list[int]) -> list[int]:
        """Of the chosen, those beyond their limits by more than their error."""
        return self.admission.beyond_limits(chosen, slack=1.0)

    def _parts(self, names: Sequence[str], candidate: Candidate, others: Sequence[int]) -> list[int]:
        """The candidates of these effects at the same place that add most to the others, each beside the rest of them:
        how sharp a Coulomb friction's sign is shows only beside the viscous one. None of those that are chosen there
        already, but at another shape: how a joint turns round, no single one may tell. Empty where there are none."""
        parts: dict[str, int] = {}
        for name in names if len(names) == 1 else (*names, *names):
            rest = [*others, *(part for own, part in parts.items() if own != name)]
            best = self._best_of(name, candidate, rest)
            if best is None or best in others:
                return []
            parts[name] = best
        return list(parts.values())

    def _best_of(self, name: str, candidate: Candidate, others: Sequence[int]) -> int | None:
        """The candidate of the named effect at the same place that adds most to the others."""
        place = self.design.hypotheses[candidate.hypothesis].place
        laws = [n for n, law in enumerate(self.design.hypotheses) if law.effect.name == name and law.place == place]
        same = np.flatnonzero(np.isin(self.scores.owner, laws)).tolist()
        gains = self.scores.gains_of(same, others)
        return max(same, key=lambda k: gains[k] - self.scores.penalty([k]), default=None)
