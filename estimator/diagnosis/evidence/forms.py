"""How exact the forms of laws are, and what a friction leaves that is a matter of its form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import read_rows
from estimator.diagnosis.evidence.maps import MEMORY, Map
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted

FORM = 0.01
"""Of the explainable: a law's form is exact to a tenth of its torque, and less than that has no name of its own."""
OF_FRICTION = 0.0025
"""Likewise of a dry friction, a twentieth of its torque: what bristles differ from Coulomb's law, or from Dahl's."""
_GOES_WITH = ("speed", MEMORY)
"""What a friction is a function of: any of its speed, or of the way since reversals."""
_REFUTED = 3.0
"""nats by which what the drives read must speak against a law before no form of it is the reason."""


def forms_of(scores: Scores, chosen: Sequence[int]) -> list[int]:
    """Candidates for the forms of dry frictions among the chosen: maps of what these are functions of, and Coulomb's
    law at other shapes, where they explain less beside them than any form is exact to.

    A friction of twenty times the noise is known to a twentieth of itself at best, which is as large as the noise: what
    goes with the speed of its joint, or with the way since reversals, is no more than that, and what goes with nothing
    of the kind is judged beside it.
    """
    return _forms(scores, chosen, ((_of_friction, OF_FRICTION),))


def beside_forms(scores: Scores, chosen: Sequence[int]) -> list[int]:
    """The chosen with the forms of their frictions (`forms_of`), and with bristles that are told as Coulomb's friction
    (`Law.mends_below`): how a joint turns round is between the laws, part of its friction goes with the sign of its
    speed, and part with the travel. In a search those stand for themselves, lest other laws mend what they do."""
    return [*chosen, *_forms(scores, chosen, ((_bristles, FORM), (_of_friction, OF_FRICTION)))]


def of_form(wide: Conditional, plain: Conditional) -> float:
    """nats that a law explains beyond a plainer one, to be held against what a form is exact to: without end where what
    the drives read while they are off refutes the plainer one, for no form of a friction bends that."""
    return np.inf if read_apart(wide, plain) else wide.explained - plain.explained


def read_apart(wide: Conditional, plain: Conditional) -> bool:
    """Whether what the drives read while they are off refutes a plainer law, and not the wider one."""
    return _by_reading(wide) - _by_reading(plain) > _REFUTED


def _by_reading(model: Conditional) -> float:
    """nats that a model explains with what the drives read, beyond those that it explains without; none where nothing
    was read."""
    told = model.told
    if (reading := told.design.reading) is None:
        return 0.0
    rows = read_rows(told.design, reading)
    unread = [gram - row @ row.T for gram, row in zip(told.block.grams, rows, strict=True)]
    by_motions = Weighted(told.design, replace(told.block, grams=unread), told.weights)
    return model.explained - Conditional(by_motions, model.active).explained


def _forms(
    scores: Scores, chosen: Sequence[int], kinds: Sequence[tuple[Callable[[Scores, int], bool], float]]
) -> list[int]:
    """Candidates of each kind in turn at the places of dry frictions, where they explain less, beside the chosen and
    those before, than the share of the explained there that a form is exact to."""
    result: list[int] = []
    for place in dict.fromkeys(scores.hypothesis(k).place for k in chosen if scores.hypothesis(k).effect.dry):
        here = [k for k in range(len(scores.owner)) if scores.hypothesis(k).place == place and k not in chosen]
        dry = next(k for k in chosen if scores.hypothesis(k).place == place)
        whole, beside = scores.nats_there(dry, chosen), list(chosen)
        for kind, exact in kinds:
            forms = [k for k in here if kind(scores, k)]
            if scores.nats([*beside, *forms]) - scores.nats(beside) < exact * whole:
                beside += forms
        result += beside[len(chosen) :]
    return result


def _bristles(scores: Scores, candidate: int) -> bool:
    """Whether it is a law of so little travel that it mends the form of what it contains."""
    below = scores.hypothesis(candidate).effect.mends_below
    return below > 0.0 and bool(scores.design.candidates[candidate].theta[0] <= below)


def _of_friction(scores: Scores, candidate: int) -> bool:
    """Whether it is any function of what a friction goes with, or dry friction itself."""
    effect = scores.hypothesis(candidate).effect
    if isinstance(effect, Map):
        return effect.quantity in _GOES_WITH and not effect.of_neighbour
    return effect.name == "coulomb_friction"
