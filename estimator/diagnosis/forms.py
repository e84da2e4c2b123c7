"""How exact the forms of laws are, and what a friction leaves that is a matter of its form."""

from __future__ import annotations

from collections.abc import Sequence

from estimator.diagnosis.maps import MEMORY, Map
from estimator.diagnosis.scores import Scores
from estimator.effects import Law

FORM = 0.01
"""Of the explainable: a law's form is exact to a tenth of its torque, and less than that has no name of its own."""
_OF_FRICTION = 0.0025
"""Likewise of a dry friction, a twentieth of its torque: what bristles differ from Coulomb's law, or from Dahl's."""
_GOES_WITH = ("speed", MEMORY)
"""What a friction is a function of: any of its speed, or of the way since reversals."""


def forms_of(scores: Scores, chosen: Sequence[int]) -> list[int]:
    """Candidates for the forms of dry frictions among the chosen: maps of what these are functions of, and Coulomb's
    law at other shapes, where they explain less beside them than any form is exact to.

    A friction of twenty times the noise is known to a twentieth of itself at best, which is as large as the noise: what
    goes with the speed of its joint, or with the way since reversals, is no more than that, and what goes with nothing
    of the kind is judged beside it.
    """
    result: list[int] = []
    for place in dict.fromkeys(scores.hypothesis(k).place for k in chosen if scores.hypothesis(k).effect.dry):
        here = [k for k in range(len(scores.owner)) if scores.hypothesis(k).place == place]
        forms = [k for k in here if k not in chosen and _of_friction(scores.hypothesis(k).effect)]
        dry = next(k for k in chosen if scores.hypothesis(k).place == place)
        if scores.nats([*chosen, *forms]) - scores.nats(chosen) < _OF_FRICTION * scores.nats_there(dry, chosen):
            result += forms
    return result


def beside_forms(scores: Scores, chosen: Sequence[int]) -> list[int]:
    """The chosen with the forms of their frictions (`forms_of`)."""
    return [*chosen, *forms_of(scores, chosen)]


def _of_friction(effect: Law) -> bool:
    """Whether it is any function of what a friction goes with, or dry friction itself."""
    if isinstance(effect, Map):
        return effect.quantity in _GOES_WITH and not effect.of_neighbour
    return effect.name == "coulomb_friction"
