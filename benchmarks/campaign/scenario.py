"""Scenarios: a plan's causes made as large as they are to be, and staged on the plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm, hidden_bodies, scattered, true_arm, without_moment, write_urdf
from benchmarks.campaign.beyond_links import evidence_beyond_links
from benchmarks.campaign.cause import Cause, Named, Tables, merged
from benchmarks.campaign.friction_causes import everywhere
from benchmarks.campaign.motions import RATE_HZ, Playlist, draw_playlist, draw_programs
from benchmarks.campaign.outside_causes import OUTSIDE
from benchmarks.campaign.plans import ALL, ASKED_FOR, CATALOGUE, Plan
from benchmarks.campaign.playing import Run, as_recorded, play, read_off
from benchmarks.campaign.sizing import Array, Scale, amplitude_for, folded_rms, noise_deviation, noise_in_band
from config import Installation
from estimator import load_rigid_body
from virtual_hw.hidden import HiddenMechanics
from virtual_hw.hidden.noise import SILENT, Noise

CURRENT_LOOP_HZ = 1e6
"""Far above the plant's tick: at 5 kHz the current is 32 µs late, which a finder may rightly name."""
RECORDED_HZ = 500.0
"""The cycle of the geared arms, which a recorder keeps whole. Every second sample of that would fold what the servo
answers to its encoder's counts into the band, three times the sensors' noise on the PUMA."""
JITTER_S = (0.0, 2e-5, 1e-4)
TOLERANCE = 0.05
"""Of the links, as the finder takes them."""
TRIES = 12
"""Joints and forms that are tried before a cause is given up on an arm."""


@dataclass(frozen=True)
class TrueCause:
    """A cause as it was put in: what the envelope holds of it."""

    label: str
    answers: frozenset[Named]
    excused: frozenset[Named]
    amplitude: float
    size: float
    parameters: dict[str, float]


@dataclass(frozen=True)
class Truth:
    """The answer to a scenario. ``excused``: names that would not be wrong, whatever the causes."""

    number: int
    arm: str
    scatter: float
    causes: tuple[TrueCause, ...]
    excused: frozenset[Named] = frozenset()
    recorded_noise: float | None = None
    """Torque noise in the recordings over the sensors', below `sizing.BAND_HZ`; median of the joints. None where it was
    not measured."""
    deviation_in_band: float | None = None
    """Standard deviation of the torque sensors' noise, in which sizes are told, over what of it lies in that band."""
    evidence: float | None = None
    """nats for the cause over links that are off by the tolerance; None but where one of the catalogue is alone."""

    def as_json(self) -> dict[str, Any]:
        """For the envelope."""
        whole = asdict(self)
        whole["excused"] = _sorted(self.excused)
        for cause in whole["causes"]:
            for key in ("answers", "excused"):
                cause[key] = _sorted(cause[key])
        return whole

    @staticmethod
    def from_json(whole: dict[str, Any]) -> Truth:
        """The same again."""
        causes = tuple(
            TrueCause(**{**cause, "answers": _set(cause["answers"]), "excused": _set(cause["excused"])})
            for cause in whole["causes"]
        )
        return Truth(**{**whole, "causes": causes, "excused": _set(whole["excused"])})


def _sorted(names: frozenset[Named]) -> list[list[str | None]]:
    return sorted(([effect, joint] for effect, joint in names), key=str)


def _set(pairs: list[list[Any]]) -> frozenset[Named]:
    return frozenset((effect, joint) for effect, joint in pairs)


@dataclass(frozen=True)
class Staged:
    """A scenario played: what the finder will see, and what it must not."""

    truth: Truth
    urdf: Path
    runs: tuple[Run, ...]


@dataclass(frozen=True)
class Prepared:
    """A scenario ready to be played, on the plant or over the wire."""

    truth: Truth
    installation: Installation
    """With the URDF that the finder gets."""
    playlist: Playlist
    hidden: HiddenMechanics
    every: int
    """Of so many samples of the plant one is recorded."""
    jitter_s: float
    seed: int
    noise: Sequence[Noise]
    """Of the torque sensors, by joint."""


def prepare(plan: Plan, urdf: Path) -> Prepared:
    """Draw and size the scenario; the URDF for the finder is written to ``urdf``.

    A kind that the arm cannot have at the wanted size gives way to the next.
    """
    rng = np.random.default_rng([plan.seed, plan.number, 1])
    arm = true_arm(plan.arm)
    write_urdf(arm, scattered(arm.bodies, plan.scatter, rng), urdf)
    installation = _with_urdf(arm.installation, urdf)
    playlist = (draw_programs if plan.rests else draw_playlist)(installation, rng, plan.seconds)
    noise = _noise_tables(arm, float(np.exp(0.3 * rng.standard_normal())))
    sensors = _torque_noise(noise, arm)
    deviation = noise_deviation(sensors)
    scale = Scale(installation, playlist, mechanics(arm, [], []), deviation)
    causes, amplitudes, true_causes = _causes(plan, arm, scale, rng)
    evidence = None
    if len(causes) == 1 and true_causes[0].answers:
        alone = mechanics(arm, causes, [causes[0].tables(amplitudes[0])])
        body, below = load_rigid_body(urdf.read_text()), noise_in_band(sensors, plan.seed)
        evidence = evidence_beyond_links(scale, alone, body, below, TOLERANCE)
    rubbing, excused = _friction(plan, arm, deviation)
    tables = [c.tables(a) for c, a in zip(causes, amplitudes, strict=True)]
    # A cause that has friction of its own puts it in the place of what its joint has.
    hidden = mechanics(arm, causes, [rubbing, *tables, noise])
    return Prepared(
        truth=Truth(plan.number, plan.arm, plan.scatter, true_causes, excused, evidence=evidence),
        installation=installation,
        playlist=playlist,
        hidden=hidden,
        every=int(RATE_HZ / RECORDED_HZ),
        jitter_s=float(rng.choice(JITTER_S)),
        seed=int(rng.integers(2**31)),
        noise=sensors,
    )


def stage(plan: Plan, folder: Path) -> Staged:
    """Play the scenario on the plant; the URDF for the finder is written into ``folder``."""
    prepared = prepare(plan, folder / "arm.urdf")
    played = play(prepared.installation, prepared.hidden, prepared.playlist, prepared.seed)
    rng = np.random.default_rng([prepared.seed, 1])
    recorded = list(played)
    if plan.drives_off_s:
        recorded.append(read_off(prepared.installation, prepared.hidden, plan.drives_off_s, prepared.seed + 1))
    runs = [as_recorded(run, prepared.installation, rng, prepared.every, prepared.jitter_s) for run in recorded]
    below = noise_in_band(prepared.noise, prepared.seed)
    share = np.hypot(1.0, folded_rms(played, prepared.every) / below)
    truth = replace(
        prepared.truth,
        recorded_noise=float(np.median(share)),
        deviation_in_band=float(np.median(noise_deviation(prepared.noise) / below)),
    )
    return Staged(truth, folder / "arm.urdf", tuple(runs))


def _causes(
    plan: Plan, arm: TrueArm, scale: Scale, rng: Generator
) -> tuple[list[Cause], list[float], tuple[TrueCause, ...]]:
    causes: list[Cause] = []
    amplitudes: list[float] = []
    true_causes: list[TrueCause] = []
    free = list(arm.joints)
    for kind in plan.kinds:
        cause, joint, amplitude, size = _fitted(kind, plan, arm, free, scale, rng)
        # Two causes on one joint would share a table of the mechanics.
        free.remove(joint)
        causes.append(cause)
        amplitudes.append(amplitude)
        true_causes.append(
            TrueCause(cause.label, cause.answers, cause.excused, amplitude, size, dict(cause.truth(amplitude)))
        )
    return causes, amplitudes, tuple(true_causes)


def _fitted(
    kind: str, plan: Plan, arm: TrueArm, free: list[str], scale: Scale, rng: Generator
) -> tuple[Cause, str, float, float]:
    kinds = next(list(some) for some in (CATALOGUE, OUTSIDE, ASKED_FOR) if kind in some)
    first = kinds.index(kind)
    for name in kinds[first:] + kinds[:first]:
        for joint in rng.permutation(free)[:TRIES].tolist():
            cause = ALL[name](arm, joint, rng)
            if cause is None:
                continue
            found = amplitude_for(cause, plan.size, partial(size_of, arm, scale, cause))
            if found is not None:
                return cause, joint, *found
    raise RuntimeError(f"scenario {plan.number}: no cause reaches {plan.size} times the noise on {plan.arm}")


def size_of(arm: TrueArm, scale: Scale, cause: Cause, amplitude: float) -> float:
    """In multiples of the noise, without what the catalogue has of the cause."""
    beside = replace(scale, clean=mechanics(arm, [], [cause.known(amplitude)]))
    return beside.size(mechanics(arm, [cause], [cause.tables(amplitude)]))


def mechanics(arm: TrueArm, causes: Sequence[Cause], tables: Sequence[Tables]) -> HiddenMechanics:
    """The arm with these causes and tables; without any it is the clean arm, silent."""
    bodies = dict(arm.bodies)
    for cause in causes:
        for joint, inertia in cause.taken_from_link.items():
            link = arm.link_of(joint)
            bodies[link] = without_moment(bodies[link], np.array([0.0, 0.0, 1.0]), inertia)
    motors = [{"joint": joint, "bandwidth_hz": CURRENT_LOOP_HZ} for joint in arm.joints]
    return HiddenMechanics.model_validate(merged([{"link": hidden_bodies(bodies), "motor": motors}, *tables]))


def _friction(plan: Plan, arm: TrueArm, noise: Array) -> tuple[Tables, frozenset[Named]]:
    if not plan.friction:
        return {}, frozenset()
    return everywhere(arm, plan.friction * noise, np.random.default_rng([plan.seed, plan.number, 2]))


def _noise_tables(arm: TrueArm, factor: float) -> Tables:
    """The clean arm's sensor noise, ``factor`` times as large."""
    tables: Tables = {}
    for table in ("angle_sensor", "velocity_sensor", "torque_sensor"):
        tables[table] = [
            {
                "joint": sensor.joint,
                "noise": {
                    "white": factor * sensor.noise.white,
                    "coloured": factor * sensor.noise.coloured,
                    "corner_hz": sensor.noise.corner_hz,
                },
            }
            for sensor in getattr(arm.noise, table)
        ]
    return tables


def _torque_noise(noise: Tables, arm: TrueArm) -> list[Noise]:
    by_joint = {sensor.joint: sensor.noise for sensor in HiddenMechanics.model_validate(noise).torque_sensor}
    return [by_joint.get(joint, SILENT) for joint in arm.joints]


def _with_urdf(installation: Installation, urdf: Path) -> Installation:
    return installation.model_copy(update={"arm": installation.arm.model_copy(update={"urdf": urdf.absolute()})})
