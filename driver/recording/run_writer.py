"""One run as one MCAP file: cycles in, messages out."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from mcap.records import Attachment

from config import InputError, Installation
from driver.cia402.temperatures import TemperatureInput
from driver.cyclic.cycle import Cycle, LoopState
from driver.recording import ros2_definitions as ros2
from driver.recording.chunked_file import ChunkedFile
from driver.recording.installation_attachments import file_attachment, installation_attachments
from driver.recording.message_records import (
    NO_WRENCH,
    BytesRecord,
    CanFrameRecord,
    JointStateRecord,
    LogRecord,
    TemperatureRecord,
    WrenchRecord,
)
from driver.wrench import WrenchParser, make_parser

FLUSH_NS = 40_000_000
"""A chunk spans at most this much of the recording's own time, so a killed process loses less than 100 ms."""
LEVELS = {LoopState.LATCHED: LogRecord.ERROR, LoopState.STOPPING: LogRecord.WARN}
JOINT_STATES, COMMAND, FEEDFORWARD, EVENTS = "/joint_states", "/command", "/feedforward", "/events"
TEMPERATURE = "/temperature/"
METADATA = "etude"


def wrench_topics(installation: Installation) -> list[str]:
    """/wrench for the first sensor, /wrench/<name> for others."""
    return ["/wrench" if k == 0 else f"/wrench/{s.name}" for k, s in enumerate(installation.wrench_sensor)]


def temperature_topics(installation: Installation) -> dict[int, str]:
    """/temperature/<joint>, by the number of the joint, of those whose drives tell it."""
    return {k: f"{TEMPERATURE}{installation.joint[k].name}" for k in TemperatureInput(installation).joints}


def can_topics(installation: Installation) -> list[str]:
    """Topics of the raw frames, one a bus, in the installation's order."""
    return [f"/can/{bus.name}" for bus in installation.bus]


def serial_topics(installation: Installation) -> list[str]:
    """Topics of the raw serial bytes, one a sensor, in the installation's order."""
    return [f"/serial/{sensor.name}" for sensor in installation.wrench_sensor]


class RunWriter:
    """Writes the cycles it is given to ``path``. All messages of a cycle carry its time as log time and its index
    as sequence number, so that lost cycles show and replay can group them.

    /wrench and /temperature/… hold every sample of sensor and drives, decoded here from the recorded bytes by what
    replay uses.
    Nothing in the file comes from a clock or a random source: equal cycles give equal bytes.
    """

    def __init__(
        self, path: Path, installation: Installation, metadata: Mapping[str, str], attach: Sequence[Path] = ()
    ) -> None:
        """Create the file. ``metadata`` is kept as it is; ``attach``: further files to keep inside, the model for one.

        Raises InputError when the file is already there or cannot be made.
        """
        self.path = path
        self.cycles = 0
        self._installation = installation
        self._metadata = {"arm": installation.arm.name, **metadata}
        self._attachments: list[Attachment] = [
            *installation_attachments(installation, 0),
            *(file_attachment(file, 0) for file in attach),
        ]
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        except FileExistsError:
            raise InputError(str(path), "is already there", "choose another name; nothing was overwritten") from None
        except OSError as error:
            raise InputError(str(path), f"cannot be made ({error.strerror})", "check the directory") from None
        # Held while the file grows: recovery leaves a file alone that somebody is writing.
        fcntl.flock(fd, fcntl.LOCK_EX)
        self._stream = os.fdopen(fd, "wb", buffering=0)
        self._file = ChunkedFile(self._stream)
        self._temperatures = TemperatureInput(installation)
        self._parsers: list[WrenchParser] = [make_parser(s) for s in installation.wrench_sensor]
        self._chunk_start_ns: int | None = None
        self._index = 0
        self._time_ns = 0
        self._open_channels()

    def _open_channels(self) -> None:
        schemas = {name: self._file.register_schema(name, text) for name, text in ros2.DEFINITIONS.items()}

        def channel(topic: str, kind: str) -> int:
            return self._file.register_channel(topic, schemas[kind], {})

        names = self._installation.joint_names
        self._joint_states = channel(JOINT_STATES, ros2.JOINT_STATE)
        self._command = channel(COMMAND, ros2.JOINT_STATE)
        self._feedforward = channel(FEEDFORWARD, ros2.JOINT_STATE)
        self._events = channel(EVENTS, ros2.LOG)
        self._joint_states_record = JointStateRecord(self._joint_states, names, (True, True, True))
        self._command_record = JointStateRecord(self._command, names, (True, True, True))
        self._feedforward_record = JointStateRecord(self._feedforward, names, (False, False, True))
        self._log_record = LogRecord(self._events, self._installation.arm.name)
        self._can = [
            (number, CanFrameRecord(number).head)
            for number in (channel(topic, ros2.CAN_FRAME) for topic in can_topics(self._installation))
        ]
        self._wrench = [
            (number, WrenchRecord(number, sensor.frame))
            for sensor, number in zip(
                self._installation.wrench_sensor,
                [channel(topic, ros2.WRENCH_STAMPED) for topic in wrench_topics(self._installation)],
                strict=True,
            )
        ]
        self._temperature = {
            joint: (number, TemperatureRecord(number, names[joint]))
            for joint, topic in temperature_topics(self._installation).items()
            for number in (channel(topic, ros2.TEMPERATURE),)
        }
        self._serial = [
            (number, BytesRecord(number))
            for number in (channel(topic, ros2.BYTES) for topic in serial_topics(self._installation))
        ]

    def warm_up(self, cycle: Cycle) -> None:
        """Add only the raw channels of a cycle before the run's first: what decoders remember from it.

        A drive without velocity object is differentiated from one position to the next, a sensor's clock starts at
        one frame and counts from the second; replay needs the one before as the live decoders had it.
        """
        self._arrange(cycle)
        self._write_raw(cycle, measured=False)

    def write(self, cycle: Cycle) -> None:
        """Add one cycle. Raises OSError when the disk refuses."""
        self._arrange(cycle)
        now, sequence = cycle.time_ns, self._index
        self.cycles += 1
        add = self._file.add_message
        joint_states, command = self._joint_states_record, self._command_record
        add(self._joint_states, now, joint_states.pack(sequence, now, now, cycle.q, cycle.dq, cycle.tau))
        add(self._command, now, command.pack(sequence, now, now, cycle.q_d, cycle.dq_d, cycle.tau_command))
        add(self._feedforward, now, self._feedforward_record.pack(sequence, now, now, cycle.tau_ff))
        self._write_raw(cycle, measured=True)
        for sentence in cycle.events:
            add(
                self._events,
                now,
                self._log_record.pack(sequence, now, LEVELS.get(cycle.state, LogRecord.INFO), sentence),
            )

    def _arrange(self, cycle: Cycle) -> None:
        """Begin the file at its first cycle, and a chunk when the last one spans long enough."""
        now = cycle.time_ns
        if self._chunk_start_ns is None:
            self._begin(now)
        elif now - self._chunk_start_ns >= FLUSH_NS or now < self._chunk_start_ns:
            self._file.flush()
            self._chunk_start_ns = now
        self._index, self._time_ns = cycle.index & 0xFFFF_FFFF, now

    def _write_raw(self, cycle: Cycle, *, measured: bool) -> None:
        """Frames and bytes as they passed; what they tell of wrench and temperatures only when ``measured``."""
        now, sequence, add = cycle.time_ns, self._index, self._file.add_message
        together, channel_id, head, pack = None, 0, b"", CanFrameRecord.pack
        for bus, time_ns, sent, data in cycle.frames:
            if together != (bus, time_ns, sent):
                together = bus, time_ns, sent
                channel_id, record_head = self._can[bus]
                head = record_head(sequence, now, time_ns, sent)
            add(channel_id, now, pack(head, data))
            warmth = None if sent or not measured else self._temperatures.read(bus, data)
            if warmth is not None:
                own_id, temperature = self._temperature[warmth.joint]
                add(own_id, now, temperature.pack(sequence, now, time_ns, warmth.celsius))
        for sensor, data in cycle.serial:
            channel_id, raw = self._serial[sensor]
            add(channel_id, now, raw.pack(sequence, now, data))
            samples = self._parsers[sensor].feed(data, now)
            if measured:
                channel_id, record = self._wrench[sensor]
                for sample in samples:
                    values = sample.values if sample.fresh else NO_WRENCH
                    add(channel_id, now, record.pack(sequence, now, sample.stamp_ns, values))

    def _begin(self, now: int) -> None:
        for attachment in self._attachments:
            attachment.log_time = now
            self._file.add_attachment(attachment)
        self._attachments = []
        self._file.add_metadata(METADATA, self._metadata)
        self._chunk_start_ns = now

    def note(self, sentence: str, level: int = LogRecord.WARN) -> None:
        """Add a sentence of the recorder's own to /events, at the time of the last cycle."""
        if self._chunk_start_ns is None:
            self._begin(self._time_ns)
        record = self._log_record.pack(self._index, self._time_ns, level, sentence)
        self._file.add_message(self._events, self._time_ns, record)

    def flush(self) -> None:
        """Hand everything so far to the operating system."""
        self._file.flush()

    def finish(self) -> None:
        """Complete the file and put it on the disk.

        Raises OSError when the disk refuses; the file stays recoverable.
        """
        if self._chunk_start_ns is None:
            self._begin(self._time_ns)
        try:
            self._file.finish()
            os.fsync(self._stream.fileno())
        finally:
            self._stream.close()

    def abandon(self) -> None:
        """Close without completing, after an error; `recover` makes the file readable."""
        self._stream.close()
