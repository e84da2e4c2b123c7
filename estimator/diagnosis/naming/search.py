"""Forward selection of causes, with every earlier choice judged again after each step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from estimator.diagnosis.evidence.borne_out import BORNE_OUT
from estimator.diagnosis.evidence.forms import forms_of
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import INSTEAD, Admission
from estimator.diagnosis.naming.lack_of_fit import left_to_see
from estimator.diagnosis.naming.rivals import AMBIGUOUS, rivals
from estimator.diagnosis.naming.special_cases import SpecialCases

_MOST_CAUSES_A_JOINT = 5
_TRIED = 4
"""Hypotheses that a step tries before it gives up, beside those that explain errors alone."""
_TURNS = 3
"""Times that the walk goes on after a cause has fallen: what it stood for may have another name."""


class Search:
    """The walk from the given model to causes; `Search.run` takes it."""

    def __init__(self, scores: Scores) -> None:
        self.scores = scores
        self.design = scores.design
        self.admission = Admission(scores)
        self.specials = SpecialCases(self.admission)
        self._fallen: set[int] = set()
        """Hypotheses that were taken and did not improve what is predicted of rows left out."""

    def run(self, start: Sequence[int] = ()) -> list[int]:
        """The candidates of all causes; ``start``: those of other scores, to begin with."""
        if start:
            self.scores.reweigh(start)
        chosen = self._grown(self.pruned(list(start)))
        if (divided := self._divided(chosen)) != chosen:
            chosen = self._grown(divided)
        for _ in range(_TURNS):
            before = self.pruned(self._swapped(chosen))
            chosen = self._standing(before)
            if set(chosen) == set(before):
                break
            self._fallen |= {int(self.scores.owner[k]) for k in set(before) - set(chosen)}
            chosen = self._grown(chosen)
        return self._telling(self._standing(self.pruned(chosen)))

    def again(self, chosen: list[int]) -> list[int]:
        """The candidates of all causes, where these were under other scores: they still are, unless one more is
        supported."""
        self.scores.reweigh(chosen)
        return chosen if next(self._steps(chosen), None) is None else self.run(chosen)

    def ordered(self, chosen: Sequence[int]) -> list[int]:
        """These candidates joint by joint, that without which most is lost first, and so within a joint."""
        whole = self.scores.nats(chosen)
        lost = {k: whole - self.scores.nats([c for c in chosen if c != k]) for k in chosen}
        most: dict[int | None, float] = {}
        for k in chosen:
            most[self._joint(k)] = max(lost[k], most.get(self._joint(k), 0.0))
        return sorted(chosen, key=lambda k: (-most[self._joint(k)], -lost[k]))

    def _grown(self, chosen: list[int]) -> list[int]:
        """With one more cause after the other, as long as any is supported."""
        self.scores.reweigh(chosen)
        limit = _MOST_CAUSES_A_JOINT * self.design.body.n
        # A cause that is put in another's place, or taken out again, must not come back for ever.
        seen = {frozenset(chosen)}
        while len({self.scores.owner[k] for k in chosen}) < limit:
            grown = next((g for g in self._steps(chosen) if frozenset(g) not in seen), None)
            if grown is None:
                break
            chosen = grown
            seen.add(frozenset(chosen))
            self.scores.reweigh(chosen)
        return chosen

    def _steps(self, chosen: list[int]) -> Iterator[list[int]]:
        """What the model may become by one more cause, the best supported first; nothing when none is supported."""
        ranked = [row for row in self.scores.ranked(chosen) if int(self.scores.owner[row[0]]) not in self._fallen]
        refused: list[int] = []
        tries = _TRIED
        for candidate, _, supported in ranked:
            if tries == 0 or supported <= 0.0:
                return
            if not self.admission.borne_out(candidate, chosen):
                tries -= 1
                refused.append(candidate)
            elif self.admission.recurs(candidate, chosen):
                tries -= 1
                grown = [*chosen, self._sooner(candidate, refused, chosen)]
                yield self.pruned(self._merged(self.specials.simplified(grown), self._joint(candidate)))

    def _sooner(self, admitted: int, refused: Sequence[int], chosen: list[int]) -> int:
        """A better supported cause of the same place that a little more chance would have been let in for, or the one
        that was admitted: that there is something, this one shows."""
        place = self.scores.hypothesis(admitted).place
        here = (k for k in refused if self.scores.hypothesis(k).place == place)
        return next((k for k in here if self.admission.admitted(k, chosen, INSTEAD)), admitted)

    def _merged(self, chosen: list[int], joint: int | None) -> list[int]:
        """One effect in place of several at this joint, where that is better supported."""
        at = [k for k in chosen if joint is not None and self._joint(k) == joint and not self.scores.recurs(k)]
        best, support = chosen, self.scores.support(chosen)
        for count in range(2, len(at) + 1):
            for leaving in combinations(at, count):
                others = [k for k in chosen if k not in leaving]
                for candidate, _, _ in [row for row in self.scores.ranked(others) if self._joint(row[0]) == joint][:3]:
                    trial = [*others, candidate]
                    if (value := self.scores.support(trial)) > support:
                        best, support = trial, value
        return best

    def _divided(self, chosen: list[int]) -> list[int]:
        """A cause that several joints share, as one of a transmission or a link do, in causes of their own, where those
        are better supported."""
        for k in chosen:
            if not (joints := self._sharing(k)):
                continue
            trial = [c for c in chosen if c != k]
            for joint in joints:
                own = [row[0] for row in self.scores.ranked(trial) if self._alone_at(row[0], joint)][:_TRIED]
                admitted = next((c for c in own if self.admission.admitted(c, trial)), None)
                trial = trial if admitted is None else [*trial, admitted]
            if self.scores.support(trial) > self.scores.support(chosen):
                chosen = trial
        return chosen

    def _sharing(self, candidate: int) -> list[int]:
        """The joints that share a cause; none where it is of a single one, or of the arm."""
        hypothesis = self.scores.hypothesis(candidate)
        joint, other = hypothesis.place.joint, hypothesis.place.other
        if joint is None:
            return []
        if other is not None:
            return [joint, other]
        before = self.design.body.ancestors(joint)
        return list(reversed(before)) if hypothesis.effect.of_link and len(before) > 1 else []

    def _alone_at(self, candidate: int, joint: int) -> bool:
        hypothesis = self.scores.hypothesis(candidate)
        return hypothesis.place.joint == joint and hypothesis.place.other is None and not hypothesis.effect.of_link

    def _joint(self, candidate: int) -> int | None:
        return self.scores.hypothesis(candidate).place.joint

    def pruned(self, chosen: list[int]) -> list[int]:
        """Without causes that the others have made superfluous or impossible, the least supported first, and without
        what is left in the place of an offset that was read otherwise."""
        while wrong := self.specials.beyond(chosen):
            chosen = self._possible(chosen, wrong[0])
        left = self._without_superfluous(chosen, least=0.0)
        return [k for k in left if not self.admission.read_otherwise(k, [c for c in left if c != k])]

    def _without_superfluous(self, chosen: list[int], least: float) -> list[int]:
        """Without causes that the model hardly needs, by ``least`` nats of support, the least needed first."""
        while chosen:
            whole = self.scores.support(chosen)
            loss = {k: whole - self.scores.support([c for c in chosen if c != k]) for k in chosen}
            weakest = min(loss, key=lambda k: loss[k])
            if loss[weakest] > least:
                break
            chosen = [c for c in chosen if c != weakest]
        return chosen

    def _possible(self, chosen: list[int], beyond: int) -> list[int]:
        """Without a cause that is ``beyond`` its limits; or, where that is better supported, with what it contains in
        its place, or without another of its place that drove it there: of two frictions, the one that takes what is
        not there of the other."""
        place = self.scores.hypothesis(beyond).place
        trials = [[c for c in chosen if c != k] for k in chosen if self.scores.hypothesis(k).place == place]
        if special := self.specials.of(beyond, chosen):
            trials.append(special)
        allowed = [t for t in trials if beyond not in t or beyond not in self.specials.beyond(t)]
        return max(allowed, key=self.scores.support)

    def _swapped(self, chosen: list[int]) -> list[int]:
        """Each cause against all that could stand in its place."""
        for _ in range(2):
            before = list(chosen)
            for k in before:
                if k not in chosen:
                    continue
                others = [c for c in chosen if c != k]
                better = [r.candidate for r in rivals(self.admission, k, chosen)[:3] if r.gap < 0.0]
                better = [r for r in better if self.admission.admitted(r, others)]
                best = max(better, key=lambda c: self.scores.support([*others, c]), default=k)
                if self.scores.support([*others, best]) > self.scores.support(chosen):
                    chosen = self.specials.simplified([*others, best])
            if set(before) == set(chosen):
                break
        return chosen

    def _standing(self, chosen: list[int]) -> list[int]:
        """Without causes that, given all others, do not improve what is predicted of rows left out, or do not recur
        with the motion, the worst first."""
        for judge, least in ((self.scores.held_out, BORNE_OUT), (self.admission.recurring, 1.0)):
            while chosen:
                worth = {k: judge(k, [c for c in chosen if c != k]) for k in chosen}
                worst = min(worth, key=lambda k: worth[k])
                if worth[worst] > least:
                    break
                chosen = [c for c in chosen if c != worst]
        return chosen

    def _telling(self, chosen: list[int]) -> list[int]:
        """Without causes in whose stead nothing is as good, and without those that explain a trifle of what any model
        could, or of the noise, wherever they act: they mend the others' forms, or the noise's, and their names would
        mislead. A cause that explains all but the noise of what is left without it is none of these, nor is one that
        does beside the forms of frictions. All orders of a periodic law are judged as one."""
        chosen = self._without_superfluous(chosen, least=AMBIGUOUS)
        forms = forms_of(self.scores, chosen)
        beside = [(some, left_to_see(self.scores, [*chosen, *some])) for some in ([[], forms] if forms else [[]])]
        while chosen:
            told = {k: max(self.admission.told(k, chosen, misfit, some) for some, misfit in beside) for k in chosen}
            least = min(told, key=lambda k: told[k])
            if told[least] > 1.0:
                break
            # One after the other: of two that tell the same, each alone is a trifle beside the other.
            chosen = [c for c in chosen if self.scores.owner[c] != self.scores.owner[least]]
        return chosen
