"""Identifies the links of an arm from recorded motion (thesis, chapter 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import base_parameters
from estimator.channel_noise import channel_noise
from estimator.column_noise import column_noise
from estimator.estimation import OF_NOISE, Estimate, Estimator, KnownNoise, Prior, estimate
from estimator.filtering import motion_band
from estimator.held_by_friction import speeds_to_leave_out
from estimator.identification import Fit, LinkIdentification, TorqueResidual
from estimator.lack_of_fit import Playings, find_playings, lack_of_fit
from estimator.leave_one_out import leave_one_out
from estimator.maximum_likelihood import maximum_likelihood
from estimator.normal_equations import assemble, residual_autocovariance, torque_power
from estimator.rigid_body import RigidBody
from estimator.rows import Layout, friction_widths, make_layout, sum_up
from estimator.sums import Sums
from estimator.terms import PARAMETER_OF, TERM_NAMES, TermName, candidate_terms
from estimator.trajectory import Trajectory
from estimator.whitening import white_weight

Array = NDArray[np.float64]

__all__ = ["Estimator", "LinkOptions", "Prior", "identify_links"]

_BAND_OVER_MOTION = 10.0
"""The torque of a motion holds harmonics of its velocity; ten times its band keeps them."""
_LEAST_BAND, _WIDEST_BAND = 5.0, 25.0
"""Hz. Above some 25 Hz arms swing on their joints and are no rigid bodies."""


@dataclass(frozen=True)
class LinkOptions:
    """How to identify. ``band_hz`` None: taken from the motion. ``terms``: what may be fitted beside the rigid body;
    each is kept only where the data support it, unless ``select_terms`` is false."""

    estimator: Estimator = "optimal_filter"
    band_hz: float | None = None
    terms: tuple[TermName, ...] = TERM_NAMES
    select_terms: bool = True


def identify_links(
    body: RigidBody,
    trajectories: Sequence[Trajectory],
    options: LinkOptions | None = None,
    hold_out: Sequence[Trajectory] = (),
    prior: Prior | None = None,
) -> LinkIdentification:
    """Base parameters, friction, rotor inertias and offsets with standard errors.

    One pass sums the recordings up; everything else is algebra on the sums. Measured velocities and angles are joined
    by their noise spectra. By ``options.estimator``:

    - ``optimal_filter``: each joint's equations divided by the noise that stands in them, of the torque and of the
      motion carried through the model, iterated on the unknowns (thesis, Eq. 5.49), and the noise of the columns taken
      out of the normal equations (total least squares). Noise comes from repeats where motion recurs.
    - ``maximum_likelihood``: refined from there with the true motion among the unknowns, which comes nearest the
      Cramér–Rao bound where the motion's noise is strong, and takes seconds a minute of recording.
    - ``total_least_squares``: the same as ``optimal_filter`` without the filter, each joint weighted by its residual.
    - ``least_squares``: all joints and frequencies alike. ``weighted``: each joint by its residual, iteratively.
    - ``whitened``: also by the residual's colour, which takes what the model lacks for noise.
    - ``instrumental_variables``: weighted, with the regressor of the commanded motion as instruments; all trajectories
      must then have `Trajectory.q_desired`; ``tests`` says whether noise in the motion mattered (Durbin–Wu–Hausman).

    With a ``prior``, what the motion tells badly stays near it: for short motions of arms with many joints.

    Raises InputError for recordings that do not fit the arm, or have no usable motion.
    """
    options = options or LinkOptions()
    _check(body, trajectories, options)
    base = base_parameters(body)
    band = options.band_hz or float(np.clip(_BAND_OVER_MOTION * motion_band(trajectories), _LEAST_BAND, _WIDEST_BAND))
    candidates = candidate_terms(options.terms, friction_widths(trajectories))
    by_instruments = options.estimator == "instrumental_variables"
    noise = channel_noise(trajectories)
    crossover = None if noise is None else noise.crossover(band)
    rest = None
    if "coulomb_friction" in options.terms:
        rest = speeds_to_leave_out(body, base, trajectories, band, crossover)
    layout = make_layout(body, base, candidates, by_instruments, rest, crossover)
    sums = sum_up(layout, trajectories, band)
    if sums.rows * body.n < 2 * layout.size and (prior is None or not sums.rows):
        raise InputError(
            "recordings",
            f"{sums.duration:.2g} s of gapless motion are too short for {layout.size} unknowns at {band:.3g} Hz",
            "record longer motion",
        )
    playings = find_playings(layout, trajectories, band)
    known = None
    if options.estimator in OF_NOISE and noise is not None:
        known = KnownNoise(column_noise(layout, trajectories, band, noise), playings.pure_error)
    found = estimate(layout, sums, options.estimator, options.select_terms, prior, known)
    if options.estimator == "maximum_likelihood":
        if noise is None:
            raise InputError("recordings", "are too short to tell the motion's noise", "use the estimator 'weighted'")
        unknowns = np.zeros(layout.size)
        unknowns[found.chosen] = found.solution.value
        power = residual_autocovariance(layout, sums.batches, unknowns)[:, 0]
        found = maximum_likelihood(layout, trajectories, band, noise, found, power)
    return _result(layout, sums, options, trajectories, hold_out, band, found, playings)


def _check(body: RigidBody, trajectories: Sequence[Trajectory], options: LinkOptions) -> None:
    if not trajectories:
        raise InputError("recordings", "there are none", "give at least one")
    for trajectory in trajectories:
        if trajectory.q.shape[1] != body.n:
            raise InputError(
                trajectory.name,
                f"has {trajectory.q.shape[1]} joints, the arm has {body.n} ({', '.join(body.joints)})",
                "select the arm's joints, or hold the others",
            )
        if options.estimator == "instrumental_variables" and trajectory.q_desired is None:
            raise InputError(
                trajectory.name, "has no commanded motion to take instruments from", "use the estimator 'weighted'"
            )
    if not any(np.any(np.fmax.reduce(t.q, axis=0) > np.fmin.reduce(t.q, axis=0)) for t in trajectories):
        raise InputError("recordings", "no joint moves", "record motion that excites the arm")


def _warnings(trajectories: Sequence[Trajectory]) -> list[str]:
    """What is missing in the recordings, or looks saturated."""
    result: list[str] = []
    for trajectory in trajectories:
        lost, gaps = trajectory.missing()
        if lost or gaps:
            result.append(f"{trajectory.name}: {lost} incomplete samples and {gaps} gaps are left out")
    return result


def _result(
    layout: Layout,
    sums: Sums,
    options: LinkOptions,
    trajectories: Sequence[Trajectory],
    hold_out: Sequence[Trajectory],
    band: float,
    found: Estimate,
    playings: Playings,
) -> LinkIdentification:
    warnings = [*_warnings(trajectories), *_refusals(layout, found)]
    rank, chosen, solution = layout.base.rank, found.chosen, found.solution
    all_terms = [term for terms in layout.terms for term in terms]
    kept_terms = [k for k in chosen if k >= rank]
    reported = [*range(rank), *kept_terms]
    unknowns, covariance = np.zeros(layout.size), np.full((layout.size, layout.size), np.nan)
    unknowns[chosen] = solution.value
    covariance[np.ix_(chosen, chosen)] = solution.covariance
    freedom = np.zeros(layout.size)
    freedom[chosen] = solution.degrees_of_freedom
    missing = [layout.base.names[k] for k in found.untold]
    plain = assemble(layout, sums, np.array([white_weight(1.0)] * layout.body.n))
    eigenvalues = np.linalg.eigvalsh(plain.of([k for k in chosen if k < rank]).total)
    status = "identified"
    if missing and found.untold[0] in chosen:
        warnings.append(f"the motion does not tell {', '.join(missing)}: these are the prior's")
    elif missing:
        status = "too little motion"
        warnings.append(
            f"the motion does not excite {', '.join(missing)}: move {_idle_joints(layout, found.untold)} more"
        )
    elif not solution.degrees_of_freedom.any():
        status = "too little data"
        warnings.append("too short for standard errors: record longer, or several motions")
    held_out = None
    if hold_out:
        held_out = _fit(layout, sum_up(layout, hold_out, band), unknowns)
    return LinkIdentification(
        body=layout.body,
        base=layout.base,
        terms=tuple(all_terms[k - rank] for k in kept_terms),
        value=unknowns[reported],
        covariance=covariance[np.ix_(reported, reported)],
        degrees_of_freedom=freedom[reported],
        estimator=options.estimator,
        band=band,
        samples=sums.samples,
        duration=sums.duration,
        condition_number=float(np.sqrt(eigenvalues[-1] / eigenvalues[0])) if eigenvalues[0] > 0.0 else math.inf,
        fit=_fit(layout, sums, unknowns),
        hold_out=held_out,
        status=status,
        warnings=tuple(warnings),
        tests=_tests(layout, found),
        lack_of_fit=lack_of_fit(playings, unknowns, len(chosen), sums.rows),
        leave_one_out=_by_name(trajectories, leave_one_out(layout, sums, found)),
    )


def _by_name(trajectories: Sequence[Trajectory], values: dict[int, float]) -> dict[str, float]:
    names = [trajectory.name for trajectory in trajectories]
    return {names[k] if names.count(names[k]) == 1 else f"{names[k]} {k + 1}": value for k, value in values.items()}


def _refusals(layout: Layout, found: Estimate) -> list[str]:
    """Terms whose sign nothing physical has: what they stand for is not their name."""
    all_terms = [term for terms in layout.terms for term in terms]
    result: list[str] = []
    for k, value in found.refused.items():
        term = all_terms[k - layout.base.rank]
        what, unit = term.name.replace("_", " "), PARAMETER_OF[term.name][1]
        result.append(f"{what} of {layout.body.joints[term.joint]} would be {value:.3g} {unit}: impossible, left out")
    return result


def _tests(layout: Layout, found: Estimate) -> dict[str, dict[str, float | str]]:
    if found.hausman is None:
        return {}
    terms = [f"{term.name} of {layout.body.joints[term.joint]}" for terms in layout.terms for term in terms]
    differs_most = [*layout.base.names, *terms][found.hausman.unknown]
    return {"durbin_wu_hausman": {"p_value": found.hausman.p_value, "differs_most": differs_most}}


def _idle_joints(layout: Layout, missing: Sequence[int]) -> str:
    """The joints of the first link of each base parameter of ``missing``."""
    links = sorted({int(np.flatnonzero(layout.base.combination[k])[0]) // 10 for k in missing})
    return ", ".join(layout.body.joints[link] for link in links)


def _fit(layout: Layout, sums: Sums, unknowns: Array) -> Fit:
    variance = residual_autocovariance(layout, sums.batches, unknowns)[:, 0]
    power = torque_power(layout, sums.batches)
    noise = np.zeros(layout.body.n) if sums.high_frequency is None else sums.high_frequency / sums.rows
    moving = sums.counted / sums.rows
    joints = {
        axis.name: TorqueResidual(
            float(np.sqrt(v)), float(np.sqrt(v / p)) if p > 0.0 else 0.0, float(np.sqrt(e)), axis.torque_unit, c
        )
        for axis, v, p, e, c in zip(layout.body.axes, variance, power, noise, moving.tolist(), strict=True)
    }
    relative = 100.0 * float(np.sqrt(variance @ moving / (power @ moving)))
    return Fit(joints, relative, sums.samples, sums.rows)
