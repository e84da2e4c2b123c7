"""A session that practises one motion: replays for repeatability, then trial after trial (Section 6.3)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.paths import state_directory
from driver.plan import Plan
from driver.recording import Recording, read_recording
from learner.practice import Practice
from learner.trial import Timing, Trial
from learner.velocity_sensor import VelocityCalibration, calibrate, from_angles
from service.practice.answers import practice_answer, ratio_text
from service.practice.course import Course, PracticeArguments, course
from service.practice.record import Play, PlayKind, PracticeRecord, read_feedforward, read_record, write_feedforward
from service.practice.taught import Taught, effects_answer, what_was_taught
from service.practice.trials import ActuationLag, actuation_lag, as_demanded, trial_of
from service.reports.practice_plot import plot_practice
from service.sessions.moving import MovingArm
from service.sessions.procedure import Tell, within
from service.sessions.store import Kind, Session, SessionStore

Array = NDArray[np.float64]
WORSE = 1.2
"""Times the first trial's error: more is not practice any more."""
WORSE_THAN_FIRST = "the last trial was worse than the first"
CHANGED_IN_A_ROW = 2
NEAR_IN_A_ROW = 2


class Practise:
    """Model, limits and certificate are settled before the first replay moves; a refused operator moves nothing."""

    kind: Kind = "practise"

    def __init__(self, installation: Installation, arguments: PracticeArguments) -> None:
        self._installation = installation
        self._record = PracticeRecord()
        self._asked = arguments
        if arguments.resume is not None:
            self._take_up(arguments)
        self._course: Course = course(self._asked, installation)
        self._task = self._course.task()
        self._plan(self._task.timing.command(self._task.base), "first")
        self._delay = self._course.practised.command_delay

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        plays = self._asked.replays + self._asked.trials
        tell("enabling the drives", 0.0)
        await moving.enable(self._asked.mode)
        base = self._task.timing.command(self._task.base)
        # Friction remembers from where the arm came: the first play comes to its start as all others do.
        await moving.go_to(self._task.reference.q[-1], self._asked.mode, lambda share: None)
        while (done := len(self._record.of("replay"))) < self._asked.replays:
            part = within(tell, f"replay {done + 1} of {self._asked.replays}", done / plays, (done + 1) / plays)
            await self._play(moving, session, "replay", base, part)
        tell("measuring repeatability", self._asked.replays / plays)
        practice, calibration, lag = await asyncio.to_thread(self._begin)
        names = self._installation.joint_names
        # Trials of a session taken up again are learnt from, not played.
        for path in self._record.of("trial"):
            practice.take(await asyncio.to_thread(self._trial, path, calibration), names)
        stopped = _reason_to_stop(practice)
        while stopped is None and len(practice.lessons) <= self._asked.trials:
            k = len(practice.lessons)
            stage = f"trial {k} of {self._asked.trials} (last: {ratio_text(practice)})"
            begin = (self._asked.replays + k - 1) / plays
            part = within(tell, stage, begin, begin + 1 / plays)
            path = await self._play(moving, session, "trial", practice.command, part)
            trial = await asyncio.to_thread(self._trial, path, calibration)
            await asyncio.to_thread(practice.take, trial, names)
            stopped = _reason_to_stop(practice)
        await moving.disable()
        learnt = session.directory / "feedforward.csv"
        kept = practice.command
        if stopped == WORSE_THAN_FIRST:
            kept = await asyncio.to_thread(self._played, practice.best, base)
            stopped += "; kept is the feedforward of " + (f"trial {practice.best}" if practice.best else "the replays")
        write_feedforward(learnt, kept, self._task.reference.period, names)
        plot = session.directory / "practice.png"
        await asyncio.to_thread(
            plot_practice, plot, self._course.practised.name, names, practice, self._task, self._course.certificate
        )
        stopped = stopped or _played_to_the_end(practice.left(names))
        answer = practice_answer(self._course, practice, names, stopped, lag)
        taught = await asyncio.to_thread(self._taught, practice)
        return {
            "session": session.id,
            **answer,
            "taught": effects_answer(taught.effects, names),
            "resumed": self._asked.resume,
            "recordings": [play.recording for play in self._record.plays],
            "feedforward": str(learnt),
            "plot": str(plot),
        }

    def _played(self, lesson: int, base: Array) -> Array:
        """The command of a lesson (`Practice.best`): ``base`` of the replays, else as its trial was sent."""
        if lesson == 0:
            return base
        trials = [play for play in self._record.plays if play.kind == "trial"]
        sent = Path(trials[lesson - 1].feedforward)
        return read_feedforward(sent, self._installation.joint_names, len(base))

    def _taught(self, practice: Practice) -> Taught:
        found = self._course
        band = self._asked.learnt_up_to(found.certificate.band_hz)
        return what_was_taught(found.model, found.practised, practice.torque, band)

    def _take_up(self, arguments: PracticeArguments) -> None:
        """Continue an earlier session: its arguments, but for what was asked anew, and its recordings."""
        assert arguments.resume is not None
        earlier = SessionStore(state_directory(), self._installation.arm.name).open(arguments.resume)
        if earlier.record.kind != "practise":
            raise InputError(f"session {earlier.id}", f"is a {earlier.record.kind} session", "name one that practised")
        was = PracticeArguments.model_validate(earlier.record.arguments)
        if arguments.motion != was.motion:
            raise InputError(
                f"session {earlier.id}", f"practised {was.motion}, not {arguments.motion}", "name the same motion"
            )
        self._asked = was.model_copy(update={"resume": earlier.id, "trials": arguments.trials})
        self._record = read_record(earlier.directory)

    def _plan(self, command: Array, name: str) -> Plan:
        return self._course.practised.plan(command, f"{self._course.practised.name}-{name}")

    async def _play(
        self, moving: MovingArm, session: Session, kind: PlayKind, command: Array, tell: Callable[[float], None]
    ) -> Path:
        """Play the feedforward once, from the motion's start, and enter it in the record when it came to its end."""
        number = len(self._record.of(kind)) + 1
        name = f"{kind}-{number:02d}"
        plan = self._plan(command, name)
        await moving.go_to(plan.q[0], plan.mode, lambda share: tell(0.5 * share))
        feedforward = session.directory / f"{name}.csv"
        write_feedforward(feedforward, command, self._task.reference.period, self._installation.joint_names)
        metadata = {"motion": self._course.practised.name, "mode": plan.mode, "practice": name}
        path = await moving.play_recorded(plan, session, metadata, lambda share: tell(0.5 + 0.5 * share))
        play = Play(kind=kind, recording=str(path), feedforward=str(feedforward))
        self._record.add(play, session.directory)
        return path

    def _begin(self) -> tuple[Practice, VelocityCalibration, ActuationLag]:
        reference, loop = self._task.reference, self._task.loop
        recordings = [read_recording(path) for path in self._record.of("replay")]
        raw = [self._raw(recording) for recording in recordings]
        lag = actuation_lag(recordings, loop, reference, self._asked.mode)
        self._lag = lag.cycles
        timing = Timing(self._task.timing.held, lag.cycles)
        # The shift of the replays' own feedforward is part of what they lacked.
        self._task = replace(self._task, timing=timing)
        calibration = calibrate(raw, reference)
        trials = [self._acting(*pair, calibration) for pair in zip(recordings, raw, strict=True)]
        practice = Practice(self._task, trials, self._asked.hand_picked_hz, self._course.as_counted())
        return practice, calibration, lag

    def _trial(self, path: Path, calibration: VelocityCalibration) -> Trial:
        recording = read_recording(path)
        return self._acting(recording, self._raw(recording), calibration)

    def _acting(self, recording: Recording, raw: Trial, calibration: VelocityCalibration) -> Trial:
        """The trial as it is learnt from."""
        practised, mode = self._course.practised, self._asked.mode
        joints = ~practised.velocity_measured
        trial = calibration.apply(raw)
        return as_demanded(trial, recording, practised.reference, practised.loop, mode, self._lag, joints)

    def _raw(self, recording: Recording) -> Trial:
        trial = trial_of(recording, self._task.reference, self._delay, str(recording.path))
        band = self._task.certificate.band_hz
        return from_angles(trial, self._task.reference, ~self._course.practised.velocity_measured, band)


def _played_to_the_end(left: tuple[str, ...]) -> str:
    if not left:
        return "all trials were played"
    return (
        "all trials were played; above repeatability (and the share of the error's power where the joint lets go and "
        f"comes to rest): {', '.join(left)}"
    )


def _reason_to_stop(practice: Practice) -> str | None:
    """Why no further trial is worth playing; None while one is."""
    first, last = practice.lessons[0], practice.lessons[-1]
    if practice.near_in_a_row >= NEAR_IN_A_ROW:
        return f"the error of {NEAR_IN_A_ROW} trials in a row cannot be told from repeatability"
    if practice.changed_in_a_row >= CHANGED_IN_A_ROW:
        return "the arm has changed: " + "; ".join(last.findings)
    if last.learnt and bool((last.velocity_error_rms > WORSE * first.velocity_error_rms).any()):
        return WORSE_THAN_FIRST
    return None
