"""The motions of a session: some to learn from, each played more than once, and others to be judged on.

All begin and end at rest at the arm's home, so that they follow each other in any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from config import Installation
from config.motion import SampledMotion
from config.motion.curves import Array, Curve, Fourier, RestToRest

RATE_HZ = 1000.0
SHARE_OF_LIMITS = 0.8
SMALLEST = 0.4
REST_S = 0.25
"""Standing still before each motion, recorded with it."""
_ORDER = ("a", "b", "c", "a", "b", "c", "held-out-a", "held-out-a")


@dataclass(frozen=True)
class Playlist:
    """``order`` names motions in the order they are played; those that begin with ``held-out`` are not learnt from."""

    motions: dict[str, SampledMotion]
    order: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        return sum(self.motions[name].duration_s for name in self.order)


def draw_playlist(installation: Installation, rng: Generator, seconds: float) -> Playlist:
    """Excitation, way points and slow sweeps, each twice, of about ``seconds`` together, and one held-out motion.

    ``installation`` gives home and limits.
    """
    each = seconds / 6.0
    motions = {
        "a": _sampled("a", _excitation(installation, rng, each), installation),
        "b": _sampled("b", _way_points(installation, rng, each), installation),
        "c": _sampled("c", _sweeps(installation, rng, each), installation),
        "held-out-a": _sampled("held-out-a", _mixed(installation, rng, 0.7 * each), installation),
    }
    return Playlist(motions, _ORDER)


def draw_programs(installation: Installation, rng: Generator, seconds: float) -> Playlist:
    """As `draw_playlist`, of motions from point to point that move some of the joints at a time, and rest between for
    two fifths of the time: what an arm does at work."""
    lengths = {"a": 1.0, "b": 1.0, "c": 1.0, "held-out-a": 0.7}
    motions = {
        name: _sampled(name, _program(installation, rng, length * seconds / 6.0), installation)
        for name, length in lengths.items()
    }
    return Playlist(motions, _ORDER)


def _span(installation: Installation) -> tuple[Array, Array, Array]:
    """Home, and how far each joint may go below and above it, rad."""
    home = np.array(installation.arm.home_rad)
    low, high = np.array([j.limits.position_rad for j in installation.joint]).T
    return home, SHARE_OF_LIMITS * np.maximum(low - home, -2.0), SHARE_OF_LIMITS * np.minimum(high - home, 2.0)


def _excitation(installation: Installation, rng: Generator, seconds: float) -> Curve:
    """Five harmonics on every joint, as an identification experiment has them."""
    home, low, high = _span(installation)
    harmonics, fade = 5, 1.0
    shape = rng.standard_normal((2, harmonics, len(home))) / np.arange(1, harmonics + 1)[None, :, None]
    t = np.linspace(0.0, 1.0, 400)[:, None] * 2 * np.pi * np.arange(1, harmonics + 1)
    path = np.sin(t) @ shape[0] + np.cos(t) @ shape[1]
    room = np.minimum(-low / np.maximum(-path.min(0), 1e-9), high / np.maximum(path.max(0), 1e-9))
    full = max(seconds - 2 * fade, 2.0)
    return Fourier(home, shape[0] * room, shape[1] * room, 1.0 / full, full, fade)


def _way_points(installation: Installation, rng: Generator, seconds: float) -> Curve:
    home, low, high = _span(installation)
    moves = max(3, round(seconds / 1.8))
    points = [home + rng.uniform(low, high) for _ in range(moves - 1)]
    return RestToRest(
        np.array([home, *points, home]), (rng.uniform(0.7, 1.3, moves) * seconds / moves).tolist(), 5, 0.15
    )


def _program(installation: Installation, rng: Generator, seconds: float) -> Curve:
    home, low, high = _span(installation)
    moves = max(3, round(seconds / 2.2))
    points = [home]
    for _ in range(moves - 1):
        goes = rng.random(len(home)) < 0.6
        goes[rng.integers(len(home))] = True
        points.append(np.where(goes, home + rng.uniform(low, high), points[-1]))
    times = rng.uniform(0.5, 1.4, moves) * 0.6 * seconds / moves
    return RestToRest(np.array([*points, home]), times.tolist(), 5, 0.4 * seconds / moves)


def _sweeps(installation: Installation, rng: Generator, seconds: float) -> Curve:
    """Every joint to and fro, at rates that differ from joint to joint and are slow for some."""
    home, low, high = _span(installation)
    cycles = rng.permutation(np.arange(1, len(home) + 1) % 4 + 1)
    harmonics = int(cycles.max())
    sine, cosine = np.zeros((harmonics, len(home))), np.zeros((harmonics, len(home)))
    sine[cycles - 1, np.arange(len(home))] = np.minimum(-low, high) * rng.uniform(0.5, 1.0, len(home))
    full = max(seconds - 2.0, 2.0)
    return Fourier(home, sine, cosine, 1.0 / full, full, 1.0)


def _mixed(installation: Installation, rng: Generator, seconds: float) -> Curve:
    return _way_points(installation, rng, seconds) if rng.uniform() < 0.5 else _excitation(installation, rng, seconds)


def _sampled(name: str, curve: Curve, installation: Installation) -> SampledMotion:
    """At the plant's rate, with a rest before and after. Where the arm's limits ask for it, the curve is shrunk about
    home, down to `SMALLEST` of its reach, and then slowed.
    """
    t = np.arange(int(curve.duration_s * RATE_HZ) + 1) / RATE_HZ
    home = np.array(installation.arm.home_rad)
    _, dq, ddq = curve.evaluate(t)
    speed, acceleration = (
        float(np.max(np.abs(x) / np.array([getattr(j.limits, limit) for j in installation.joint])) / SHARE_OF_LIMITS)
        for x, limit in ((dq, "velocity_rad_s"), (ddq, "acceleration_rad_s2"))
    )
    reach = min(1.0, max(SMALLEST, 1.0 / max(speed, acceleration)))
    slower = max(1.0, speed * reach, np.sqrt(acceleration * reach))
    t = np.arange(int(curve.duration_s * slower * RATE_HZ) + 1) / RATE_HZ
    q, dq, ddq = curve.evaluate(t / slower)
    rest = int(REST_S * RATE_HZ)
    pad = ((rest, rest), (0, 0))
    return SampledMotion(
        np.arange(len(t) + 2 * rest) / RATE_HZ,
        np.pad(home + reach * (q - home), pad, mode="edge"),
        np.pad(reach * dq / slower, pad),
        np.pad(reach * ddq / slower**2, pad),
        name,
    )
