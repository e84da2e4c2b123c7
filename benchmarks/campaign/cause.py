"""One way in which an arm of the campaign differs from its URDF: where, how much, and the stand-in's tables for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm
from virtual_hw.hidden.mechanics import ONE_EACH

Tables = dict[str, Any]
"""Sections of hidden mechanics, as their TOML file would have them."""
Named = tuple[str, str | None]
"""An effect of the catalogue, and the joint it is said to be on; None for the whole arm."""


@dataclass(frozen=True)
class Cause:
    """``tables(amplitude)`` puts it into the stand-in. Its torque grows with the amplitude, from 0.

    Attributes:
        label: what it is called in the campaign's tables.
        answers: the answers that are right; none for what the catalogue does not have.
        start: an amplitude to begin the search for the wanted size with.
        limit: the largest amplitude that leaves the arm usable.
        least: the smallest that the plant can step, or that the given model's tolerance does not hold.
        truth: the catalogue's parameters at an amplitude, where the two forms have them in common.
        excused: answers that are not the right ones, and not wrong either.
        taken_from_link: rotor inertia, kg·m² by joint, that the tables bring as a mass of its own.
        known: of a cause outside the catalogue, the tables of what the catalogue has of it; its size is that of the
            rest.
    """

    label: str
    answers: frozenset[Named]
    tables: Callable[[float], Tables]
    start: float
    limit: float
    truth: Callable[[float], Mapping[str, float]] = field(default=lambda amplitude: {})
    excused: frozenset[Named] = frozenset()
    taken_from_link: Mapping[str, float] = field(default_factory=dict)
    least: float = 0.0
    known: Callable[[float], Tables] = field(default=lambda amplitude: {})

    @property
    def outside(self) -> bool:
        """Whether the catalogue lacks it."""
        return not self.answers


Draw = Callable[[TrueArm, str, Generator], Cause | None]
"""A cause of one kind on a joint, its form drawn; None where the arm or the joint cannot have it."""


def named(effect: str, *joints: str | None) -> frozenset[Named]:
    """The answer that names ``effect`` on any of these joints."""
    return frozenset((effect, joint) for joint in joints)


def limit_nm(arm: TrueArm, joint: str) -> float:
    """A twentieth of what the joint's motor may give."""
    return 0.05 * arm.installation.joint[arm.joints.index(joint)].limits.torque_nm


def top_speed(arm: TrueArm, joint: str) -> float:
    """The joint's velocity limit, rad/s."""
    return arm.installation.joint[arm.joints.index(joint)].limits.velocity_rad_s


def merged(parts: list[Tables]) -> Tables:
    """Tables of several causes as one; entries for the same joint, link or sensor are put together."""
    whole: Tables = {}
    for part in parts:
        for name, value in part.items():
            if not isinstance(value, list):
                whole[name] = value
                continue
            entries: list[dict[str, Any]] = whole.setdefault(name, [])
            key = ONE_EACH.get(name)
            for entry in value:
                same = next((e for e in entries if key and e[key] == entry[key]), None)
                if same is None:
                    entries.append(dict(entry))
                else:
                    same.update(entry)
    return whole
