"""The unknowns of a load's fit, and where the columns of each measured channel stand among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.loads.wrench_regressor import CHANNELS

Array = NDArray[np.float64]

Offset = Literal["none", "constant", "drift", "each"]
"""What of the sensor is estimated with the load: ``drift``, an offset that changes linearly over the session;
``each``, an offset of its own in every recording."""


@dataclass(frozen=True)
class LoadLayout:
    """Unknowns: ``common`` ones that all channels share, the load's ten first; then ``kinds``, kind after kind, one of
    each for every fitted channel. ``channels`` are numbers among ``labels``."""

    channels: tuple[int, ...]
    kinds: tuple[str, ...] = ()
    labels: tuple[str, ...] = CHANNELS
    common: int = 10

    @property
    def names(self) -> tuple[str, ...]:
        """Of the channels, those that are fitted."""
        return tuple(self.labels[c] for c in self.channels)

    @property
    def size(self) -> int:
        return self.common + len(self.kinds) * len(self.channels)

    @property
    def alike(self) -> list[list[int]]:
        """Groups of fitted channels with noise of one colour: a wrist sensor's forces, its torques; others alone."""
        if self.labels != CHANNELS:
            return [[k] for k in range(len(self.channels))]
        groups = [[k for k, c in enumerate(self.channels) if (c < 3) == force] for force in (True, False)]
        return [group for group in groups if group]

    @property
    def offset_of_each(self) -> bool:
        """Whether every recording has an offset of its own."""
        return "offset 0" in self.kinds

    def place(self, kind: str) -> slice:
        """Where the unknowns of a kind stand, channel after channel."""
        first = self.common + self.kinds.index(kind) * len(self.channels)
        return slice(first, first + len(self.channels))

    def unknowns(self, k: int) -> list[int]:
        """Where the columns of the k-th fitted channel stand among all unknowns."""
        own = (self.common + k + len(self.channels) * j for j in range(len(self.kinds)))
        return [*range(self.common), *own]


def wrench_layout(channels: tuple[int, ...], offset: Offset, recordings: int) -> LoadLayout:
    """Of the wrench's ``channels``, for that many recordings."""
    if offset == "each":
        return LoadLayout(channels, tuple(f"offset {number}" for number in range(recordings)))
    return LoadLayout(channels, {"none": (), "constant": ("offset",), "drift": ("offset", "drift")}[offset])


def sensor_columns(layout: LoadLayout, clock: Array, number: int) -> list[Array]:
    """Columns of the sensor's unknowns for samples at session times ``clock`` s of recording ``number``."""
    if layout.offset_of_each:
        return [np.full_like(clock, float(kind == f"offset {number}")) for kind in layout.kinds]
    return [np.ones_like(clock), clock][: len(layout.kinds)]
