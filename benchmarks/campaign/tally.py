"""The campaign's figures over many judged scenarios, each with its interval and its goal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from benchmarks.campaign.judging import Judgement
from benchmarks.campaign.scenario import Truth

Z = 1.96
SIZES = ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 1.5), (1.5, np.inf))
"""Ranges of effect / noise that are tallied apart."""
DECIDABLE = 10.0
"""nats: one of some hundred hypotheses explains less by chance, nineteen times in twenty. With less for the truth over
links within their tolerance, that tolerance alone tells no cause; where the links are exact, a finder may learn so."""


@dataclass(frozen=True)
class CampaignFigure:
    """``value`` of ``count`` cases; a share has a 95 % interval. ``goal`` bounds it from below, or is ``at_most``."""

    name: str
    value: float
    count: int
    interval: tuple[float, float] | None = None
    goal: float | None = None
    at_most: bool = False

    @property
    def reached(self) -> bool | None:
        """None without a goal or without cases."""
        if self.goal is None or not self.count:
            return None
        return self.value <= self.goal if self.at_most else self.value >= self.goal


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % score interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    share, z2 = hits / count, Z * Z
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = Z * sqrt(share * (1 - share) / count + z2 / (4 * count**2)) / (1 + z2 / count)
    return max(0.0, middle - half), min(1.0, middle + half)


def tally(judged: Sequence[Judgement]) -> list[CampaignFigure]:
    """Every figure of the campaign."""
    clean = [j for j in judged if j.clean]
    single = [j for j in judged if len(j.truth.causes) == 1 and not j.outside]
    several = [j for j in judged if len(j.truth.causes) > 1]
    outside, inside = ([j for j in judged if j.outside is there] for there in (True, False))
    sets, told_sets = ([one for j in some for one in j.sets] for some in (judged, inside))
    parameters = [p for j in judged for p in j.parameters]
    figures = [_share("false alarms on clean arms, family-wise", clean, lambda j: j.alarm, 0.05, True)]
    for low, high in SIZES:
        within = [j for j in single if low <= j.size < high]
        name = f"effect and joint right, effect/noise {low:g} to {high:g}"
        goal = 0.9 if low >= 0.9 else 0.75 if low >= 0.3 else None
        figures.append(_share(name, within, lambda j: j.right, goal))
        figures.append(
            _share(name.replace("right", "right or in the set named"), within, lambda j: "missed" not in j.outcomes)
        )
    told = [j for j in single if (j.truth.evidence or 0.0) >= DECIDABLE]
    for low, high in SIZES:
        within = [j for j in told if low <= j.size < high]
        name = f"effect and joint right, effect/noise {low:g} to {high:g}, links refuted"
        figures.append(_share(name, within, lambda j: j.right))
    outcomes = [outcome for j in several for outcome in j.outcomes]
    figures += [
        _share("each of several causes named", outcomes, lambda outcome: outcome == "named"),
        _share("confidently wrong", judged, lambda j: bool(j.wrong) and not j.outside_flagged, 0.02, True),
        _share("ambiguous sets that hold a true cause", sets, lambda one: one.holds, 0.95),
        _share("ambiguous sets where the catalogue has all of it, that do", told_sets, lambda one: one.holds),
        _median("size of ambiguous sets, median", [one.size for one in sets], 2.0),
        _share("outside effects flagged unknown", outside, lambda j: bool(j.outside_flagged), 0.9),
        _share("flagged unknown where the catalogue has all of it", inside, lambda j: j.flagged),
        _share("parameters within 1.96 standard errors", parameters, lambda p: abs(p.error) <= Z * p.standard_error),
        _median("relative error of parameters, median", [abs(p.error / p.truth) for p in parameters if p.truth]),
        _gain(judged),
        _median("seconds a diagnosis, median", [j.seconds for j in judged]),
    ]
    return figures + _noise([j.truth for j in judged])


def _share(
    name: str, cases: Sequence[object], hit: Callable[..., bool], goal: float | None = None, at_most: bool = False
) -> CampaignFigure:
    hits = sum(1 for case in cases if hit(case))
    value = hits / len(cases) if cases else float("nan")
    return CampaignFigure(name, value, len(cases), wilson(hits, len(cases)), goal, at_most)


def _median(name: str, values: Sequence[float], goal: float | None = None) -> CampaignFigure:
    value = float(np.median(values)) if values else float("nan")
    return CampaignFigure(name, value, len(values), None, goal, at_most=True)


def _gain(judged: Iterable[Judgement]) -> CampaignFigure:
    """Over the scenarios whose causes the catalogue has."""
    shares = [j.gain for j in judged if j.gain is not None and j.truth.causes and not j.outside]
    value = float(np.mean(shares)) if shares else float("nan")
    return CampaignFigure(
        "held-out gain, share of an oracle's who knows the truth, mean", value, len(shares), None, 0.9
    )


def _noise(truths: Sequence[Truth]) -> list[CampaignFigure]:
    """By arm: what its recordings have beside its sensors' noise, and what the unit of sizes is in the band that is
    compared."""
    figures = []
    for arm in sorted({truth.arm for truth in truths}):
        own = [truth for truth in truths if truth.arm == arm]
        recorded = [x for truth in own if (x := truth.recorded_noise) is not None]
        unit = [x for truth in own if (x := truth.deviation_in_band) is not None]
        figures += [
            _median(f"torque noise as recorded / of the sensors, {arm}", recorded),
            _median(f"size one, in multiples of the noise below 15 Hz, {arm}", unit),
        ]
    return figures


def mistaken(judged: Iterable[Judgement]) -> list[tuple[str, str, int]]:
    """What was named for what it was not: (truth, wrong name, how often), the most frequent first."""
    seen = Counter(
        (" + ".join(sorted(cause.label for cause in j.truth.causes)) or "clean", wrong[0])
        for j in judged
        for wrong in j.wrong
    )
    return [(truth, name, count) for (truth, name), count in seen.most_common()]
