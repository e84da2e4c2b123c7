"""A load from joint torques alone: what a loaded motion needs beyond the free arm (thesis, section 3.1, without the
wrist's sensor).

    tau = load's regressor · phi + what the free arm needs

Where the same motion was recorded free, its torques are that need, friction, ripple and cogging included; only the
small difference of the two paths is taken from the model that the free recordings identify. For other motions the
whole need is that model's. Its parameters are unknowns beside the load's, believed as far as the free recordings tell
them, so their errors reach the load's. What friction changes by (warmth, the load itself) is an unknown of each joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from config import InputError
from estimator.consistency import parameters_of, pseudo_inertia
from estimator.filtering import Decimator, FilterPlan, Motion, plan_filter, resample, smooth_motion
from estimator.identification import LinkIdentification
from estimator.links import LinkOptions, Prior, identify_links
from estimator.loads.fit import Believed, LoadFit, fit_load
from estimator.loads.frame_motion import sensor_frame
from estimator.loads.layout import LoadLayout
from estimator.loads.parameters import RigidLoad
from estimator.loads.same_motion import FreeTwin, free_twin
from estimator.regressor import regressor_blocks
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK
from estimator.sums import Sums
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

KINDS = ("offset", "viscous", "coulomb")
"""By what a joint's friction may differ with the load on."""
_COULOMB_WIDTH = 0.03
"""Of the sigmoid, as a share of the joint's rms speed."""
_SLOWEST = 0.2
"""Share of the fastest joint's rms speed below which a joint's own is not believed: noise of its encoder."""
_STANDS = 2.0
"""Widths of the sigmoid below which a joint counts as standing: it may then hold by friction, and its torque says
nothing."""
_UNTOLD = 100.0
"""SI: standard error of a parameter that the free recordings do not tell."""
_LEAST_ROWS = 20


@dataclass(frozen=True)
class TorqueLoad:
    """``load`` in the flange's frame. ``paired``: of each loaded recording the free one of the same motion, or None."""

    load: RigidLoad
    fit: LoadFit
    layout: LoadLayout
    links: LinkIdentification
    band: float
    samples: int
    rows: int
    paired: tuple[str | None, ...]
    histories: tuple[TorqueDifference, ...]
    widening: float = 1.0
    """By how much the standard errors were widened for what the free arm's model gets wrong."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class TorqueDifference:
    """Of one loaded recording, (rows, n) N·m in the band: torque beyond the free arm's, and what the load needs; NaN
    rows between gapless stretches. ``t`` (rows,) s."""

    t: Array
    measured: Array
    predicted: Array


def load_from_torques(
    body: RigidBody,
    frame: str,
    loaded: Sequence[Trajectory],
    free: Sequence[Trajectory],
    band_hz: float | None = None,
) -> TorqueLoad:
    """Mass, centre and inertia as far as the joints feel them, with standard errors under coloured noise.

    ``frame``: the link of the URDF in which the load is told. Where a loaded motion was not recorded free, the model's
    own faults are in the answer: the same is then done to each free recording by the others, whose load is known to be
    none, and the covariance is widened by as much as those answers miss it.

    Raises InputError for recordings that do not fit the arm, or are too short.
    """
    found = _fitted(body, frame, loaded, free, band_hz)
    if None not in found.paired:
        return found
    if len(free) < 2:
        remedy = "give a second free recording, or the same motion free"
        return replace(found, warnings=(f"what the free arm's model gets wrong is not in the errors: {remedy}",))
    misses = [
        _miss(_fitted(body, frame, [left_out], [other for other in free if other is not left_out], found.band))
        for left_out in free
    ]
    widening = max(1.0, float(np.sqrt(np.mean(np.concatenate(misses)))))
    load = RigidLoad(found.load.parameters, found.load.covariance * widening**2)
    return replace(found, load=load, widening=widening)


def _miss(found: TorqueLoad) -> Array:
    """Squares of how many standard errors a load that is none was found to be, a parameter that is told each."""
    told = np.isfinite(found.load.parameters)
    return np.asarray(found.load.parameters[told] ** 2 / np.diag(found.load.covariance)[told])


def _fitted(
    body: RigidBody, frame: str, loaded: Sequence[Trajectory], free: Sequence[Trajectory], band_hz: float | None
) -> TorqueLoad:
    for trajectory in loaded:
        if trajectory.q.shape[1] != body.n:
            raise InputError(trajectory.name, f"has {trajectory.q.shape[1]} joints, the arm has {body.n}")
    links = free_arm(body, free, band_hz)
    layout = LoadLayout(tuple(range(body.n)), KINDS, body.joints, 10 + len(links.value))
    twins = [free_twin(trajectory, free) for trajectory in loaded]
    sums = Sums()
    for number, (trajectory, twin) in enumerate(zip(loaded, twins, strict=True)):
        for _, columns, samples in difference_rows(body, frame, links, trajectory, twin):
            sums.add(columns, number, np.array([c.any(axis=0).astype(float) for c in columns]))
            sums.samples += samples
    if sums.rows < _LEAST_ROWS:
        raise InputError(
            "recordings",
            f"have {sums.rows} rows of gapless loaded motion at {links.band:.3g} Hz, {_LEAST_ROWS} are needed",
            "record longer motion without gaps",
        )
    fit = fit_load(layout, sums, [believed_of_model(links, layout, 10)])
    return TorqueLoad(
        load=RigidLoad(fit.value[:10], fit.covariance[:10, :10]),
        fit=fit,
        layout=layout,
        links=links,
        band=links.band,
        samples=sums.samples,
        rows=sums.rows,
        paired=tuple(None if twin is None else twin.name for twin in twins),
        histories=tuple(
            _difference(layout, fit, list(difference_rows(body, frame, links, trajectory, twin)))
            for trajectory, twin in zip(loaded, twins, strict=True)
        ),
    )


def free_arm(body: RigidBody, free: Sequence[Trajectory], band_hz: float | None) -> LinkIdentification:
    """The model of the free arm, near the URDF's bodies where the free recordings do not tell."""
    believed = Prior(body.prior()) if np.all(body.prior().reshape(-1, 10)[:, 0] > 0.0) else None
    return identify_links(body, free, LinkOptions(band_hz=band_hz), prior=believed)


def believed_of_model(links: LinkIdentification, layout: LoadLayout, first: int) -> Believed:
    """That the model is right but for the errors of its identification: unknowns from ``first`` on."""
    unknown = len(links.value)
    covariance = np.where(np.isfinite(links.covariance), links.covariance, 0.0)
    untold = ~np.isfinite(np.diag(links.covariance))
    covariance[untold, untold] = _UNTOLD**2
    floor = 1e-12 * float(np.diag(covariance).max())
    rows = np.zeros((unknown, layout.size))
    rows[:, first : first + unknown] = np.eye(unknown)
    return Believed(rows, np.zeros(unknown), covariance + floor * np.eye(unknown))


def _difference(layout: LoadLayout, fit: LoadFit, pieces: list[tuple[Array, list[Array], int]]) -> TorqueDifference:
    n = len(layout.channels)
    t, measured, predicted = [], [], []
    for clock, columns, _ in pieces:
        beyond = [c[-1] - fit.filled[layout.unknowns(k)[10:]] @ c[10:-1] for k, c in enumerate(columns)]
        t += [clock, clock[-1:]]
        measured += [np.array(beyond).T, np.full((1, n), np.nan)]
        predicted += [np.array([fit.filled[:10] @ c[:10] for c in columns]).T, np.full((1, n), np.nan)]
    if not t:
        return TorqueDifference(np.zeros(0), np.zeros((0, n)), np.zeros((0, n)))
    return TorqueDifference(np.concatenate(t), np.vstack(measured), np.vstack(predicted))


def difference_rows(
    body: RigidBody, frame: str, links: LinkIdentification, trajectory: Trajectory, twin: FreeTwin | None
) -> Iterator[tuple[Array, list[Array], int]]:
    """Of each gapless stretch of a loaded recording: times, rows of each joint [load's ten | error of the free arm's
    model | `KINDS` | torque beyond the free arm's], zero where the joint stands, and the samples behind them."""
    plan = plan_filter(trajectory.rate, links.band, stride_limit=1)
    decimate = Decimator(plan.decimation)
    both = trajectory if twin is None else twin.covered(trajectory)
    speed = np.sqrt(np.nanmean(np.gradient(trajectory.q, trajectory.t, axis=0) ** 2, axis=0))
    width = _COULOMB_WIDTH * np.maximum(speed, _SLOWEST * speed.max())
    for piece in both.segments(CHUNK, 2 * plan.edge):
        if len(piece) < 2 * plan.edge + 4 * plan.decimation:
            continue
        motion, tau = _on_grid(plan, both, piece)
        blocks = _regressors(body, frame, links, motion)
        model, beyond = blocks[1], tau
        if twin is not None:
            free_motion, free_tau = _on_grid(plan, twin.on_times_of(both), piece)
            model = model - _regressors(body, frame, links, free_motion)[1]
            beyond = tau - free_tau
        beyond = beyond - model @ links.value
        moves = np.abs(motion.dq) > _STANDS * width
        t = both.t[piece[0]] + (plan.edge + np.arange(len(tau))) / plan.rate
        columns = [
            decimate(
                np.vstack(
                    [
                        blocks[0][:, joint].T,
                        model[:, joint].T,
                        np.ones(len(tau)),
                        motion.dq[:, joint],
                        np.tanh(motion.dq[:, joint] / width[joint]),
                        beyond[:, joint],
                    ]
                )
            )
            for joint in range(body.n)
        ]
        for joint, column in enumerate(columns):
            whole = minimum_filter1d(moves[:, joint], 2 * plan.decimation + 1)[:: plan.decimation]
            column *= whole[: column.shape[1]]
        yield t[:: plan.decimation][: columns[0].shape[1]], columns, len(piece)


def _on_grid(plan: FilterPlan, trajectory: Trajectory, piece: NDArray[np.intp]) -> tuple[Motion, Array]:
    t = trajectory.t[piece]
    q = resample(t, trajectory.q[piece], plan.rate)
    dq = None if trajectory.dq is None else resample(t, trajectory.dq[piece], plan.rate)
    tau = resample(t, trajectory.tau[piece], plan.rate)
    return smooth_motion(plan, q, dq, None), tau[plan.edge : len(tau) - plan.edge]


def _regressors(body: RigidBody, frame: str, links: LinkIdentification, motion: Motion) -> tuple[Array, Array]:
    """(samples, n, 10) of the load in its frame, (samples, n, unknowns) of the identified free arm."""
    carrier, moved = _parameters_on_link(body, frame)
    base, kept = links.base, list(links.base.kept)
    load = np.empty((len(motion.q), body.n, 10))
    arm = np.zeros((len(motion.q), body.n, len(links.value)))
    for rows, block in regressor_blocks(body, motion.q, motion.dq, motion.ddq):
        link = block[:, 10 * carrier : 10 * carrier + 10]
        load[rows] = np.einsum("ips,pk->sik", link, moved)
        arm[rows, :, : base.rank] = np.einsum("ips,p->sip", block[:, kept], base.sign)
    for k, term in enumerate(links.terms, base.rank):
        arm[:, term.joint, k] = term.column(motion.dq[:, term.joint], motion.ddq[:, term.joint])
    return load, arm


def _parameters_on_link(body: RigidBody, frame: str) -> tuple[int, Array]:
    """The link that carries the frame, and (10, 10) that takes parameters from the frame to it."""
    place = sensor_frame(body, frame)
    if place.joint < 0:
        raise InputError("--frame", f"{frame} does not move", "name a link behind the last joint")
    rigid = np.eye(4)
    rigid[:3, :3], rigid[:3, 3] = place.rotation, place.translation
    return place.joint, np.array([parameters_of(rigid @ pseudo_inertia(unit) @ rigid.T) for unit in np.eye(10)]).T
