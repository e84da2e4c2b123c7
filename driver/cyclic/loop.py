"""The cyclic loop: one cycle after another, from SYNC to ring."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.commission import commission
from driver.cia402.pdo import CommandNotRepresentable, PdoCodec, heartbeat
from driver.cyclic.commanding import Answer, Command
from driver.cyclic.cycle import LoopState, WrenchSample
from driver.cyclic.exchange import Begun, Exchange, LockstepExchange, open_exchange
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.gate import COMMANDING, Gate
from driver.cyclic.machine import ArmMachine
from driver.cyclic.plan_start import require_inside
from driver.cyclic.ring import RingWriter
from driver.cyclic.slot import Batch, Serial
from driver.cyclic.statistics import LoopStatistics
from driver.cyclic.status import LoopStatus, RealtimeReport
from driver.cyclic.supervision import Supervision
from driver.cyclic.tracking import Tracking
from driver.cyclic.wrench_lines import WrenchLines
from driver.gravity import RigidBody
from driver.plan import Plan

SETTLE_CYCLES = 50
"""Cycles after commissioning within which every drive must be heard of."""
FOLLOWING = frozenset({LoopState.HOLDING, LoopState.PLAYING})
GOOD_START = 0.25
"""A cycle that begins within this share of its period is on time."""


class CyclicLoop:
    """Everything of one installation that happens each cycle. `cycle` runs one; requests act at the next.

    Raises InputError when a bus, drive or sensor is not as configured.
    """

    def __init__(
        self,
        installation: Installation,
        *,
        lockstep: bool,
        ring: RingWriter,
        realtime: RealtimeReport,
        progress: Callable[[str], None],
    ) -> None:
        self.installation, self.lockstep, self.realtime = installation, lockstep, realtime
        self.ring = ring
        self.body = RigidBody(installation)
        self._names = installation.joint_names
        self._all = (1 << len(self._names)) - 1
        self._feedback = ArmFeedback(len(self._names))
        self._gate = Gate(installation)
        self._supervision = Supervision(installation)
        self._tracking = Tracking(installation)
        self._statistics = LoopStatistics(installation)
        self._runs = self._time_ns = 0
        self._good_start_ns = GOOD_START * installation.cycle.period_ns
        self._beat_every = max(1, round(installation.cycle.heartbeat_ms * 1e-3 * installation.cycle.rate_hz / 2))
        self._since_beat = self._beat_every
        self._events: list[str] = []
        self._waits: deque[tuple[int, Answer]] = deque()
        self._needs_commissioning = self._in_charge = False
        self._state_before = LoopState.COMMISSIONING
        self._exchange: Exchange | None = None
        self._machine: ArmMachine | None = None
        self._lines: WrenchLines | None = None
        try:
            self._commission(installation.modes[0], progress)
            progress("wrench sensors")
            self._lines = WrenchLines(installation)
            self._count_serial_bytes()
            self._settle()
        except BaseException:
            self.close()
            raise

    # ── requests ──

    def enable(self, mode: Mode, answer: Answer, progress: Callable[[str], None]) -> None:
        """Enable in ``mode``, after setting the drives up for it when they are not; raises InputError."""
        if mode not in self.installation.modes:
            raise InputError(
                "mode", f"{mode} is not allowed", f"this installation has {', '.join(self.installation.modes)}"
            )
        if mode != self.machine.mode and self.machine.state is LoopState.IDLE:
            self._commission(mode, progress)
            self._settle()
        if self._lines is not None:
            self._lines.reopen_lost()
            self._count_serial_bytes()
        require_inside(self.installation, self._feedback)
        self.machine.enable(answer)

    def play(self, plan: Plan) -> int:
        """Begin to play; returns the run's number. Raises InputError, with nothing moved, when the plan is refused."""
        plan.check(self.installation)
        self.machine.play(
            plan, self.body if plan.urdf is None else RigidBody(self.installation, plan.urdf), self._runs + 1
        )
        self._runs += 1
        return self._runs

    def reset(self, answer: Answer, progress: Callable[[str], None]) -> None:
        """Acknowledge the latched fault; sets the drives up anew first when one may have lost its configuration."""
        if self._needs_commissioning and self.machine.state is LoopState.LATCHED:
            self._commission(self.machine.mode, progress)
            self._settle()
        self._supervision.forget()
        self._tracking.forget()
        self.machine.clear(answer)

    def run_for(self, seconds: float, answer: Answer) -> None:
        """Answer when that much of the loop's time has passed."""
        cycles = max(1, round(seconds * self.installation.cycle.rate_hz))
        self._waits.append((self._statistics.cycles + cycles, answer))

    @property
    def machine(self) -> ArmMachine:
        """The arm's state machine: a new one after each commissioning."""
        assert self._machine is not None  # From the first commissioning on, in __init__.
        return self._machine

    @property
    def connected(self) -> bool:
        """Whether there is an exchange with the drives to cycle; not after a commissioning that failed."""
        return self._exchange is not None

    @property
    def busy(self) -> bool:
        """Whether time must pass for what was asked; lockstep stands still otherwise."""
        return self.connected and (self.machine.busy or bool(self._waits))

    # ── the cycle ──

    def cycle(self) -> None:
        """One cycle: SYNC, feedback, supervision, state machine, gate, commands, ring."""
        exchange, feedback, machine = self._live(), self._feedback, self.machine
        codec = exchange.codec
        begun = exchange.begin()
        self._time_ns = begun.time_ns
        exchange.collect()
        feedback.take(codec.feedback(), begun.time_ns)
        now_ns = exchange.now_ns
        serial: list[Serial] = []
        wrench: WrenchSample | None = None
        if self._lines:
            totals = exchange.serial_bytes if isinstance(exchange, LockstepExchange) else None
            serial, wrench = self._lines.read(now_ns, totals)
            self._events += self._lines.take_events()
        punctual = not begun.skipped and begun.late_ns <= self._good_start_ns
        found = self._supervision.look(
            codec.reception, feedback, exchange.faults, punctual=punctual, commanding=machine.state in COMMANDING
        )
        exchange.faults.clear()
        self._events += found.events
        self._needs_commissioning |= found.recommission
        astray = self._tracking.look(feedback, machine.q_d, following=machine.state in FOLLOWING)
        if astray and machine.state in COMMANDING:
            found.causes += [sentence for _, sentence in astray]
            machine.distrust(joint for joint, _ in astray)
        command = self._admitted(machine.step(feedback, found.causes))
        # Heartbeats go on while the other axes are brought to rest, however one of them fell silent.
        good = punctual and self._in_charge and not machine.silent
        command = self._send(exchange, command, good)
        batches = exchange.take_batches()
        self._publish(begun, command, wrench, batches, serial)
        self._statistics.add(begun, batches, serial, now_ns, good=good, complete=punctual and feedback.complete)
        if machine.state is LoopState.STOPPING and self._state_before is not LoopState.STOPPING:
            self._statistics.frames.freeze()
        self._state_before = machine.state
        while self._waits and self._waits[0][0] <= self._statistics.cycles:
            self._waits.popleft()[1](None)

    def _admitted(self, command: Command) -> Command:
        """The command if the gate admits it, else a stop's, else the drives' own quick stop."""
        reason = self._refusal(command)
        self._in_charge = True
        if reason is not None:
            self._events.append(f"gate: {reason}")
            command = self.machine.refused(reason)
            reason = self._refusal(command)
            if reason is not None:
                self._events.append(f"gate: {reason}; the drives stop by themselves")
                command = self.machine.failed(reason)
                self._in_charge = False
        return command

    def _refusal(self, command: Command) -> str | None:
        fb, machine = self._feedback, self.machine
        refusal = self._gate.check(
            machine.state, command.words, command.q_d, command.dq_d, command.tau, fb.q, fb.dq, fb.age,
            position_is_sent=machine.mode == "csp", torque_interval_s=command.interval_s,
        )  # fmt: skip
        return None if refusal is None else str(refusal)

    def _send(self, exchange: Exchange, command: Command, good: bool) -> Command:
        """Send the command; returns what was really sent."""
        encode = exchange.codec.encode
        try:
            frames = encode(command.words, command.q_d, command.dq_d, command.tau)
        except CommandNotRepresentable as problem:
            self._events.append(f"{problem}; the drives stop by themselves")
            command = self.machine.failed(str(problem))
            # What was sent last can be sent again.
            frames = encode(command.words, command.q_d, command.dq_d, command.tau)
        self._since_beat += 1
        if good and self._since_beat >= self._beat_every:
            self._since_beat = 0
            frames = [data + self._beat for data in frames]
        if not self.machine.silent:
            exchange.command(frames)
        self.machine.sent(command)
        return command

    def _publish(
        self,
        begun: Begun,
        command: Command,
        wrench: WrenchSample | None,
        batches: Sequence[Batch],
        serial: Sequence[Serial],
    ) -> None:
        fb, machine = self._feedback, self.machine
        events, self._events = self._events, []
        valid = self._all if fb.complete else sum(1 << i for i, ok in enumerate(fb.valid) if ok)
        self.ring.publish(
            self._statistics.cycles, begun.time_ns, begun.late_ns, machine.state, machine.playing_run, valid,
            [*fb.q, *fb.dq, *fb.tau, *command.q_d, *command.dq_d, *command.tau, *command.tau_ff],
            wrench, batches, serial, events,
        )  # fmt: skip

    # ── commissioning ──

    def _commission(self, mode: Mode, progress: Callable[[str], None]) -> None:
        """Set all drives up for ``mode`` and take up the exchange with them.

        Raises InputError when that fails; the arm is then latched, and not connected until a reset succeeds.
        """
        before, self._needs_commissioning = self._machine, True
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None
        try:
            commissioned = commission(self.installation, mode, progress=progress)
            self._exchange = open_exchange(self.installation, PdoCodec(self.installation, mode), lockstep=self.lockstep)
        except InputError as problem:
            if before is not None:
                before.latch(f"the drives could not be set up: {problem}")
            raise
        self._needs_commissioning = False
        self._tracking.forget()
        self._beat = heartbeat(commissioned.master_node)
        self._statistics.begin_traffic(self._exchange)
        self._supervision.forget({d.joint: d.words for d in commissioned.drives if d.state and d.state.faulted})
        self._feedback = ArmFeedback(len(self._names))
        self._machine = ArmMachine(self.installation, mode, self.body, self._announce)
        if before is not None:
            self._machine.continue_from(before)

    def _announce(self, sentence: str) -> None:
        self._events.append(sentence)

    def _count_serial_bytes(self) -> None:
        """Lockstep announces how many bytes a sensor's line has carried: take up counting on lines just opened."""
        if isinstance(self._exchange, LockstepExchange) and self._lines:
            self._lines.anchor(self._exchange.look)

    def _settle(self) -> None:
        """Run until every drive has been heard of, or has been silent for too long."""
        for _ in range(SETTLE_CYCLES):
            self.cycle()
            if self._feedback.complete:
                return

    def status(self) -> LoopStatus:
        """The loop now, as plain data."""
        fb, machine, exchange = self._feedback, self.machine, self._exchange
        run = machine.run
        count = self._statistics
        return LoopStatus(
            state=machine.state,
            mode=machine.mode,
            cause=machine.cause,
            time_ns=self._time_ns,
            q_d=tuple(machine.q_d),
            q=tuple(fb.q),
            dq=tuple(fb.dq),
            tau=tuple(fb.tau),
            valid=tuple(fb.valid),
            drive_states=machine.axes.in_words(fb),
            run=machine.playing_run,
            last_run=self._runs,
            progress=0.0 if run is None else run.follow.progress,
            run_outcome=None if run is None else run.outcome,
            cycles=count.cycles,
            good_cycles=count.good,
            missed=count.missed,
            lateness_us=tuple(count.lateness.counts),
            lateness_max_us=count.lateness.worst_ns / 1e3,
            cpu_us=count.cpu_us(),
            lockstep=self.lockstep,
            realtime=self.realtime,
            buses=() if exchange is None else count.bus_status(exchange),
            sensors=() if self._lines is None else self._lines.status(),
            last_frames=count.frames.frozen,
        )

    def _live(self) -> Exchange:
        if self._exchange is None:
            raise InputError("arm", "the drives are not commissioned", "reset it")
        return self._exchange

    def close(self) -> None:
        """Leave buses and lines. The drives notice by their own means; bring them to rest first."""
        if self._exchange is not None:
            self._exchange.close()
        if self._lines is not None:
            self._lines.close()
