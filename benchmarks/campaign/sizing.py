"""How large an effect is beside the noise.

Size = max over joints of rms(torque that the true rigid bodies do not explain, below `BAND_HZ`) / standard deviation of
the torque sensor's noise, sample by sample, of the motions that are learnt from, played without noise and with the
effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from benchmarks.campaign.cause import Cause
from benchmarks.campaign.motions import RATE_HZ, Playlist
from benchmarks.campaign.playing import Run, play
from config import Installation
from virtual_hw.hidden import HiddenMechanics
from virtual_hw.hidden.noise import Noise, noise_rows
from virtual_hw.plant.multibody import build_multibody

Array = NDArray[np.float64]
BAND_HZ = 15.0
EVERY = 2
"""Samples of the plant for one of the residual, which is band limited."""
EDGE_S = 0.2
FINE = 1e4
NOISE_S = 30
FAR = 2.5
"""Times the wanted size by which a first guess may miss before it is tried again."""


def in_band(x: Array, rate: float = RATE_HZ) -> Array:
    """Zero-phase low-pass of samples × channels at a rate in Hz, by default the plant's."""
    return np.asarray(sosfiltfilt(butter(2, BAND_HZ, fs=rate, output="sos"), x, axis=0))


def noise_deviation(noise: Sequence[Noise]) -> Array:
    """Standard deviation of each torque channel's noise, N·m."""
    return np.array([np.hypot(channel.white, channel.coloured) for channel in noise])


def noise_in_band(noise: Sequence[Noise], seed: int) -> Array:
    """RMS of each torque channel's noise in the band, N·m."""
    rows = list(islice(noise_rows(noise, 1.0 / RATE_HZ, seed, 0), int(NOISE_S * RATE_HZ)))
    return np.asarray(np.sqrt(np.mean(in_band(np.array(rows)) ** 2, axis=0)))


def folded_rms(runs: Sequence[Run], every: int) -> Array:
    """RMS by joint of what the torque readings gain in the band when only every so-many-th sample is kept, N·m: the
    servo's answer to its encoder's counts, and the sensor's noise, from above the band."""
    rate = RATE_HZ / every
    edge = int(EDGE_S * rate)
    squares, count = np.zeros(runs[0].tau.shape[1]), 0
    for run in runs:
        gained = (in_band(run.tau[::every], rate) - in_band(run.tau)[::every])[edge:-edge]
        squares += np.sum(gained**2, axis=0)
        count += len(gained)
    return np.sqrt(squares / count)


def left_by_bodies(
    runs: Sequence[Run], installation: Installation, clean: HiddenMechanics
) -> Iterator[tuple[str, tuple[Array, Array, Array, Array]]]:
    """Of each run its motion, and at every `EVERY`-th sample but the ends: the torque that the bodies of ``clean`` do
    not explain, in the band, N·m, then q, dq and ddq."""
    body = build_multibody(installation, clean)
    dof = list(body.dof)
    edge = int(EDGE_S * RATE_HZ) // EVERY
    for run in runs:
        dq = np.gradient(run.q, 1.0 / RATE_HZ, axis=0)
        states = [x[::EVERY] for x in (run.q, dq, np.gradient(dq, 1.0 / RATE_HZ, axis=0))]
        left = run.tau[::EVERY].copy()
        for own, *state in zip(left, *states, strict=True):
            body.data.qpos[dof], body.data.qvel[dof], body.data.qacc[dof] = state
            mujoco.mj_inverse(body.model, body.data)
            own -= body.data.qfrc_inverse[dof]
        # What is left, and not the motion, is taken into the band: torques of a band-limited motion are not those
        # torques band-limited, by up to three times the noise where a sweep is fast.
        q, dq, ddq = (x[edge:-edge] for x in states)
        yield run.motion, (in_band(left, RATE_HZ / EVERY)[edge:-edge], q, dq, ddq)


def unexplained(runs: Sequence[Run], installation: Installation, clean: HiddenMechanics) -> Array:
    """RMS by joint of the torque that the bodies of ``clean`` do not explain, N·m in the band."""
    lefts = [left for _, (left, *_) in left_by_bodies(runs, installation, clean)]
    return np.asarray(np.sqrt(np.mean(np.concatenate(lefts) ** 2, axis=0)))


@dataclass(frozen=True)
class Scale:
    """Sizes effects on one arm and playlist; ``clean`` is the arm without any, ``noise`` the standard deviation by
    joint."""

    installation: Installation
    playlist: Playlist
    clean: HiddenMechanics
    noise: Array

    def size(self, hidden: HiddenMechanics) -> float:
        """Of everything by which ``hidden`` differs from the clean arm."""
        return float(np.max(unexplained(self.played(hidden), self.installation, self.clean) / self.noise))

    def played(self, hidden: HiddenMechanics) -> list[Run]:
        """Each motion that is learnt from, once and without noise."""
        once = tuple(dict.fromkeys(name for name in self.playlist.order if not name.startswith("held-out")))
        return play(finely_counted(self.installation), hidden, replace(self.playlist, order=once), seed=0)


def finely_counted(installation: Installation) -> Installation:
    """The same arm with encoders so fine that differentiating them twice brings no noise."""
    joints = tuple(
        j.model_copy(
            update={"encoder": j.encoder.model_copy(update={"counts_per_turn": FINE * j.encoder.counts_per_turn})}
        )
        for j in installation.joint
    )
    return installation.model_copy(update={"joint": joints})


SizeAt = Callable[[float], float]
"""Size of a cause at an amplitude."""


def amplitude_for(cause: Cause, wanted: float, size_at: SizeAt) -> tuple[float, float] | None:
    """Amplitude and size where the cause is ``wanted`` times the noise; None where its limits leave it far smaller or
    larger, or what comes with it, as a shaft's elasticity with its play, is far larger."""
    amplitude = cause.start
    size = size_at(amplitude)
    for _ in range(2):
        if size <= 0.0 or not np.isfinite(size):
            return None
        nearer = float(np.clip(amplitude * wanted / size, cause.least, cause.limit))
        step = nearer / amplitude
        if 1.0 / FAR < step < FAR:
            size *= step
            amplitude = nearer
            break
        amplitude, size = nearer, size_at(nearer)
    return (amplitude, size) if 0.6 * wanted < size < wanted / 0.6 else None
