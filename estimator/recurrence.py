"""Where a motion recurs: among recordings, or as periods and passages of one.

Passages are found by recurrence of the state (angles and their slopes), followed along as far as they agree, and laid
on each other to a fraction of a sample at the least squared difference of their angles, which is the maximum of their
cross-correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

SEARCH_RATE = 50.0
"""Hz, of the averaged angles in which passages are compared."""
_NODES = 2
"""Compared samples a node of the recurrence search."""
_TOLERANCE = 0.01
"""Angles that differ by more than this share of the joint's own spread are another motion …"""
_LEAST_TOLERANCE = 2e-3
"""… but rad that no controller keeps are none (m for sliding joints)."""
_LEAST_DURATION = 0.8
"""s; a shorter passage says nothing about noise below 1 Hz."""
_LEAST_SPEED = 0.1
"""Of the rms speed: slower is a rest, which recurs without being a motion …"""
_REST = 2e-3
"""… as is what is slower than this, rad/s."""
_CHUNK = 16_384


@dataclass(frozen=True)
class Piece:
    """Gapless angles averaged onto `SEARCH_RATE`."""

    trajectory: int
    origin: float
    """s: time of the first sample, in the trajectory's own."""
    q: Array
    """(samples, n)"""


def averaged(trajectories: Sequence[Trajectory]) -> list[Piece]:
    """Angles of all gapless stretches that are long enough to hold a passage."""
    result: list[Piece] = []
    for number, trajectory in enumerate(trajectories):
        for piece in trajectory.segments(trajectory.samples, 0):
            t = trajectory.t[piece]
            count = int((t[-1] - t[0]) * SEARCH_RATE)
            if count < _LEAST_DURATION * SEARCH_RATE:
                continue
            q = np.empty((count, trajectory.q.shape[1]))
            # The mean over each period, of angles that are straight between samples: exact for any jitter.
            for begin in range(0, count, _CHUNK):
                edges = t[0] + np.arange(begin, min(begin + _CHUNK, count) + 1) / SEARCH_RATE
                first = max(0, int(np.searchsorted(t, edges[0], side="right")) - 1)
                last = int(np.searchsorted(t, edges[-1])) + 1
                times, angles = t[first:last], trajectory.q[piece[first:last]]
                steps = np.diff(times)[:, None]
                area = np.concatenate(
                    [np.zeros((1, q.shape[1])), np.cumsum(0.5 * (angles[1:] + angles[:-1]) * steps, axis=0)]
                )
                for joint in range(q.shape[1]):
                    q[begin : begin + len(edges) - 1, joint] = (
                        np.diff(_integral_at(edges, times, angles[:, joint], area[:, joint])) * SEARCH_RATE
                    )
            result.append(Piece(number, float(t[0]) + 0.5 / SEARCH_RATE, q))
    return result


def _integral_at(edges: Array, t: Array, x: Array, area: Array) -> Array:
    """The integral of straight lines through (t, x), whose values at t are ``area``, at other times."""
    left = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, len(t) - 2)
    into = edges - t[left]
    slope = (x[left + 1] - x[left]) / (t[left + 1] - t[left])
    return np.asarray(area[left] + into * (x[left] + 0.5 * slope * into))


@dataclass(frozen=True)
class Match:
    """Reference samples ``begin`` … ``end`` of one piece are those of another ``lag`` samples later."""

    piece: int
    lag: float
    begin: int
    end: int


@dataclass(frozen=True)
class Passage:
    """Where one motion is played: (piece, first position) of each playing, the reference first, and their length."""

    starts: tuple[tuple[int, float], ...]
    length: int
    mismatch: Array
    """(n,) rms difference of the angles, rad."""


class RecurrenceSearch:
    """Recurrences of all pieces; positions are samples of `SEARCH_RATE`."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = pieces
        slopes = [np.gradient(piece.q, axis=0) for piece in pieces]
        speed = [np.sqrt(np.sum(slope**2, axis=1)) for slope in slopes]
        typical = float(np.sqrt(np.mean(np.concatenate(speed) ** 2)))
        slow = max(_LEAST_SPEED * typical, _REST / SEARCH_RATE)
        self.moving = [_spread_over(s > slow) for s in speed]
        self.free = [np.ones(len(piece.q), dtype=bool) for piece in pieces]
        everything = np.concatenate([piece.q for piece in pieces])
        spread = np.std(everything, axis=0)
        self.tolerance = np.maximum(_TOLERANCE * spread, _LEAST_TOLERANCE)
        # State in units in which one node of typical motion is a distance of about one.
        node_way = _NODES * np.sqrt(np.mean(np.concatenate(slopes) ** 2, axis=0))
        unit = np.maximum(node_way, self.tolerance)
        self.states = [
            np.hstack([piece.q / unit, slope * _NODES / unit]) for piece, slope in zip(pieces, slopes, strict=True)
        ]
        self.nodes = [np.arange(0, len(piece.q), _NODES) for piece in pieces]
        self.owner = np.repeat(np.arange(len(pieces)), [len(nodes) for nodes in self.nodes])
        self.place = np.concatenate(self.nodes)
        states = np.concatenate([state[nodes] for state, nodes in zip(self.states, self.nodes, strict=True)])
        self.tree = KDTree(states)
        self.reach = float(np.sqrt(states.shape[1]))

    def passages(self) -> list[Passage]:
        """All that recurs; each stretch belongs to one passage at most."""
        result: list[Passage] = []
        window = int(_LEAST_DURATION * SEARCH_RATE)
        for number, piece in enumerate(self.pieces):
            at = 0
            while at + window <= len(piece.q):
                middle = at + window // 2
                if not (self.free[number][at : at + window].all() and self.moving[number][middle]):
                    at += window // 4
                    continue
                found = self._group(number, at, middle)
                if found is None:
                    at += window // 4
                else:
                    result.append(found)
        return result

    def _group(self, number: int, at: int, middle: int) -> Passage | None:
        matches = self._matches(number, middle)
        if not matches:
            return None
        own = [abs(m.lag) for m in matches if m.piece == number]
        longest = int(min(own)) if own else len(self.pieces[number].q)
        begins = {max(at, m.begin) for m in matches}
        spans = {(begin, min(m.end, begin + longest)) for begin in begins for m in matches}
        best: tuple[float, int, int, list[Match]] | None = None
        for begin, end in sorted(spans):
            if end - begin < _LEAST_DURATION * SEARCH_RATE or not self.free[number][begin:end].all():
                continue
            inside = self._disjoint(number, begin, end, matches)
            score = (len(inside) + 1.0) * (end - begin)
            if inside and (best is None or score > best[0]):
                best = score, begin, end, inside
        if best is None:
            return None
        _, begin, end, inside = best
        return self._made(number, begin, end, inside)

    def _matches(self, number: int, middle: int) -> list[Match]:
        """Everywhere that the motion around ``middle`` of a piece is played again."""
        node = self.states[number][middle]
        matches: list[Match] = []
        for k in sorted(self.tree.query_ball_point(node, self.reach)):
            other, lag = int(self.owner[k]), float(self.place[k] - middle)
            if other == number and abs(lag) < _LEAST_DURATION * SEARCH_RATE:
                continue
            if any(m.piece == other and abs(m.lag - lag) < 2 * _NODES for m in matches):
                continue
            match = self._followed(number, middle, other, lag)
            if match is not None and not any(m.piece == other and abs(m.lag - match.lag) < 1.0 for m in matches):
                matches.append(match)
        return matches

    def _followed(self, number: int, middle: int, other: int, lag: float) -> Match | None:
        """The lag refined by Gauss–Newton around ``middle``, and how far the motions agree from there."""
        half = int(0.5 * _LEAST_DURATION * SEARCH_RATE)
        begin, end = middle - half, middle + half
        for _ in range(4):
            step = self._lag_step(number, other, begin, end, lag)
            if step is None or abs(step) > 2 * _NODES:
                return None
            lag += step
            if abs(step) < 1e-3:
                break
        first, last = self._shared(number, other, lag)
        difference = np.abs(self._difference(number, other, first, last, lag))
        same = (
            np.all(difference < self.tolerance, axis=1)
            & self.free[other][
                np.clip(np.round(np.arange(first, last) + lag).astype(int), 0, len(self.free[other]) - 1)
            ]
        )
        if not (first <= middle < last and same[middle - first]):
            return None
        breaks = np.flatnonzero(~same) + first
        before, after = breaks[breaks < middle], breaks[breaks > middle]
        begin = int(before[-1]) + 1 if len(before) else first
        end = int(after[0]) if len(after) else last
        if end - begin < _LEAST_DURATION * SEARCH_RATE:
            return None
        step = self._lag_step(number, other, begin, end, lag)
        return Match(other, lag + (step or 0.0), begin, end)

    def _shared(self, number: int, other: int, lag: float) -> tuple[int, int]:
        """Reference samples that the other piece has too (with room for the cubic's neighbours)."""
        # By whole samples, as the cubic takes its neighbours: 1 − lag may round to a sample that it does not have.
        first = max(0, 1 - int(np.floor(lag)))
        last = min(len(self.pieces[number].q), len(self.pieces[other].q) - 2 - int(np.ceil(lag)))
        return first, last

    def _difference(self, number: int, other: int, begin: int, end: int, lag: float) -> Array:
        return _cubic_at(self.pieces[other].q, begin, end, lag) - self.pieces[number].q[begin:end]

    def _lag_step(self, number: int, other: int, begin: int, end: int, lag: float) -> float | None:
        first, last = self._shared(number, other, lag)
        begin, end = max(begin, first, 1), min(end, last, len(self.pieces[number].q) - 1)
        if end - begin < 3:
            return None
        q = self.pieces[number].q
        slope = 0.5 * (q[begin + 1 : end + 1] - q[begin - 1 : end - 1])
        energy = float(np.sum(slope**2))
        if energy <= 0.0:
            return None
        return -float(np.sum(slope * self._difference(number, other, begin, end, lag))) / energy

    def _disjoint(self, number: int, begin: int, end: int, matches: list[Match]) -> list[Match]:
        """Matches that hold the whole interval, without overlap among each other or with the reference."""
        length = end - begin
        taken: list[tuple[int, float]] = [(number, float(begin))]
        inside: list[Match] = []
        for m in sorted(matches, key=lambda m: (m.piece, m.lag)):
            start = begin + m.lag
            if m.begin > begin or m.end < end:
                continue
            if all(piece != m.piece or abs(start - other) > length - 1.5 for piece, other in taken):
                taken.append((m.piece, start))
                inside.append(m)
        return inside

    def _made(self, number: int, begin: int, end: int, inside: list[Match]) -> Passage:
        starts = [(number, float(begin))]
        square = np.zeros(self.pieces[number].q.shape[1])
        for m in inside:
            lag = m.lag + (self._lag_step(number, m.piece, begin, end, m.lag) or 0.0)
            starts.append((m.piece, begin + lag))
            first, last = self._shared(number, m.piece, lag)
            difference = self._difference(number, m.piece, max(begin, first), min(end, last), lag)
            square += np.mean(difference**2, axis=0)
        for piece, start in starts:
            self.free[piece][max(0, round(start)) : round(start) + end - begin] = False
        return Passage(tuple(starts), end - begin, np.sqrt(square / len(inside)))


def _spread_over(moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A turning point is not a rest: what is between two moving stretches of less than a second is moving."""
    result = moving.copy()
    at = np.flatnonzero(moving)
    for left, right in pairwise(at):
        if 1 < right - left < SEARCH_RATE:
            result[left:right] = True
    return result


def _cubic_at(x: Array, begin: int, end: int, lag: float) -> Array:
    """Values (end − begin, n) at begin + lag, …: the cubic through four neighbours."""
    whole = int(np.floor(lag))
    f = lag - whole
    start = begin + whole
    weights = (
        -f * (f - 1.0) * (f - 2.0) / 6.0,
        (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
        -(f + 1.0) * f * (f - 2.0) / 2.0,
        (f + 1.0) * f * (f - 1.0) / 6.0,
    )
    count = end - begin
    parts = (w * x[start + k - 1 : start + k - 1 + count] for k, w in enumerate(weights))
    return np.asarray(sum(parts, np.zeros(())))
