"""An MCAP file as a `Recording`: our own, and any other with a JointState topic."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError
from driver.recording import ros2_definitions as ros2
from driver.recording.installation_attachments import attached_installation
from driver.recording.joint_state_columns import JointStateColumns, NotJointState, joint_state_columns
from driver.recording.message_records import RECORD_HEAD_BYTES, SECOND, LogRecord
from driver.recording.recording import Array, Event, Recording, check_increasing, find_gaps, gap_notes
from driver.recording.run_writer import COMMAND, EVENTS, FEEDFORWARD, JOINT_STATES, METADATA
from driver.recording.stamped_columns import (
    NotStamped,
    StampedColumns,
    of_thermometers,
    stamped_columns,
    temperature_at,
)
from driver.recording.topic_messages import Batch, McapFile, records_by_length

JOINT_STATE_TYPES = (ros2.JOINT_STATE, "sensor_msgs/JointState")
WRENCH = "/wrench"
TEMPERATURE_TYPES = (ros2.TEMPERATURE, "sensor_msgs/Temperature")
WRENCH_TYPES = (ros2.WRENCH_STAMPED, "geometry_msgs/WrenchStamped")
Nanoseconds = NDArray[np.int64]


def read_mcap(path: Path, topic: str = JOINT_STATES) -> Recording:
    """Read the recording whose measured joints are on ``topic``.

    Raises InputError: no such topic, another type, no messages, unequal clocks, NaN (foreign files), damage.
    """
    with McapFile(path) as file:
        metadata = next((m.metadata for m in file.metadata() if m.name == METADATA), None)
        collected = _Collected(file, topic, own=metadata is not None)
        measured, notes = collected.joint_states(topic)
        stamp_ns = measured.stamp_ns
        if not stamp_ns.any():
            stamp_ns = measured.log_ns
            notes.append(f"{topic} has no time stamps: the time of logging is used")
        check_increasing(stamp_ns, f"{path}, message on {topic}, number")
        start_ns = int(stamp_ns[0])
        t: Array = (stamp_ns - start_ns) / SECOND
        columns = {"position": measured.position, "velocity": measured.velocity, "effort": measured.effort}
        if metadata is None:
            columns = {
                name: _without_nan(path, topic, name, measured.joints, values, notes)
                for name, values in columns.items()
            }
        position = columns["position"]
        if position is None:
            raise InputError(f"{path}, {topic}", "has no positions", "record joint positions in rad")
        if collected.temperatures and collected.temperatures.keys().isdisjoint(measured.joints):
            named = ", ".join(sorted(collected.temperatures))
            notes.append(f"temperatures are told of {named}, which are no joints of {topic}: they are left out")
        gaps = find_gaps(t)
        recording = Recording(
            path=path,
            joints=measured.joints,
            start_ns=start_ns,
            t=t,
            q=position,
            dq=columns["velocity"],
            tau=columns["effort"],
            temperature=temperature_at(t, start_ns, measured.joints, collected.temperatures),
            gaps=gaps,
            notes=(*notes, *gap_notes(gaps)),
        )
        if metadata is not None:
            return _with_own_channels(recording, file, collected, stamp_ns, metadata)
        return _with_foreign_wrench(recording, file, collected)


class _Collected:
    """Everything that one pass over the file's chunks gives: JointState columns, wrenches, sentences."""

    def __init__(self, file: McapFile, topic: str, *, own: bool) -> None:
        self._file = file
        self._groups: dict[str, dict[tuple[str, ...], list[JointStateColumns]]] = {}
        self._stamps: list[Nanoseconds] = []
        self._wrenches: list[Array] = []
        self.wrench_frame: str | None = None
        """As the first message says it."""
        self.temperatures: dict[str, list[StampedColumns]] = {}
        """By the frame, which is a joint's name."""
        self._sentences: list[tuple[int, int, str]] = []
        joint_states = dict.fromkeys(_checked_channels(file, topic), topic)
        wrench, events = frozenset[int](), frozenset[int]()
        if own:
            joint_states |= {c.id: c.topic for name in (COMMAND, FEEDFORWARD) for c in file.channels_of(name)}
            wrench = frozenset(channel.id for channel in file.channels_of(WRENCH))
            events = frozenset(channel.id for channel in file.channels_of(EVENTS))
        elif topics := _wrench_topics(file)[:1]:
            wrench = frozenset(channel.id for channel in file.channels_of(topics[0]))
        types = file.topics()
        told = [
            c for c in file.channels.values() if types[c.topic] in TEMPERATURE_TYPES and c.message_encoding == "cdr"
        ]
        warmth = frozenset(channel.id for channel in told)
        for batch in file.batches(wrench | events | warmth | joint_states.keys()):
            for channel_id, name in joint_states.items():
                self._take_joint_states(batch, channel_id, name)
            for channel_id in wrench:
                self._take_wrenches(batch, channel_id)
            for channel_id in warmth:
                for part in self._stamped(batch, channel_id, 2):
                    self.temperatures.setdefault(part.frame, []).append(part)
            for channel_id in events:
                self._take_sentences(batch, channel_id)

    def _take_joint_states(self, batch: Batch, channel_id: int, topic: str) -> None:
        groups = self._groups.setdefault(topic, {})
        for positions, rows in records_by_length(batch, channel_id):
            try:
                for part in joint_state_columns(positions, rows):
                    groups.setdefault(part.joints, []).append(part)
            except NotJointState as error:
                place = f"{self._file.path}, {topic}"
                raise InputError(place, f"a message is no JointState: {error}", "check what publishes it") from None

    def _take_wrenches(self, batch: Batch, channel_id: int) -> None:
        for part in self._stamped(batch, channel_id, 6):
            self.wrench_frame = self.wrench_frame or part.frame
            self._stamps.append(part.stamp_ns)
            self._wrenches.append(part.numbers)

    def _stamped(self, batch: Batch, channel_id: int, count: int) -> list[StampedColumns]:
        try:
            return list(stamped_columns(batch, channel_id, count))
        except NotStamped as error:
            channel = self._file.channels[channel_id]
            what = f"a message is no {self._file.topics()[channel.topic]}: {error}"
            raise InputError(f"{self._file.path}, {channel.topic}", what, "check what publishes it") from None

    def _take_sentences(self, batch: Batch, channel_id: int) -> None:
        for place in batch.offsets.get(channel_id, ()):
            start = int(place)
            end = start + 9 + int.from_bytes(batch.data[start + 1 : start + 9].tobytes(), "little")
            record = batch.data[start:end].tobytes()
            self._sentences.append(
                (int.from_bytes(record[15:23], "little"), *LogRecord.unpack(record[RECORD_HEAD_BYTES:]))
            )

    def joint_states(self, topic: str) -> tuple[JointStateColumns, list[str]]:
        """All messages on ``topic`` in the order of their log times, of the set of joints that most of them have;
        and a note on those of other joints. InputError when there is none."""
        groups = self._groups.get(topic)
        if not groups:
            raise InputError(f"{self._file.path}, {topic}", "has no messages", "name another topic with --topic")
        sizes = {joints: sum(len(part.positions) for part in parts) for joints, parts in groups.items()}
        joints = max(sizes, key=lambda names: (sizes[names], len(names)))
        notes = [
            f"{count} messages on {topic} of other joints ({', '.join(names) or 'none'}) are left out"
            for names, count in sizes.items()
            if names != joints
        ]
        return _joined(groups[joints]), notes

    def matching(self, topic: str, stamp_ns: Nanoseconds) -> JointStateColumns | None:
        """The messages of ``topic`` at the given stamps, NaN where there is none; None without the topic."""
        return _at_stamps(self.joint_states(topic)[0], stamp_ns) if self._groups.get(topic) else None

    def wrench(self, start_ns: int) -> tuple[Array | None, Array | None]:
        """(times in s, samples × 6) of /wrench."""
        if not self._stamps:
            return None, None
        return (np.concatenate(self._stamps) - start_ns) / SECOND, np.concatenate(self._wrenches)

    def events(self, start_ns: int) -> tuple[Event, ...]:
        found = [Event((log_ns - start_ns) / SECOND, level, text) for log_ns, level, text in self._sentences]
        return tuple(sorted(found, key=lambda event: event.t))


def _checked_channels(file: McapFile, topic: str) -> list[int]:
    found = file.channels_of(topic)
    types = file.topics()
    fitting = sorted(name for name, kind in types.items() if kind in JOINT_STATE_TYPES)
    if not found:
        remedy = f"name one with --topic: {', '.join(fitting)}" if fitting else "record sensor_msgs/msg/JointState"
        raise InputError(str(file.path), f"has no topic {topic}", remedy)
    if types[topic] not in JOINT_STATE_TYPES or found[0].message_encoding != "cdr":
        what = f"carries {types[topic] or 'messages without a type'} in {found[0].message_encoding or 'no encoding'}"
        remedy = f"name one with --topic: {', '.join(fitting)}" if fitting else "record it as a ROS 2 JointState"
        raise InputError(f"{file.path}, {topic}", f"{what}, not sensor_msgs/msg/JointState in cdr", remedy)
    return [channel.id for channel in found]


def _joined(parts: list[JointStateColumns]) -> JointStateColumns:
    order = np.argsort(np.concatenate([part.log_ns for part in parts]), kind="stable")
    first = parts[0]

    def column(name: str) -> NDArray[np.int64]:
        joined: NDArray[np.int64] = np.concatenate([getattr(part, name) for part in parts])[order]
        return joined

    def numbers(name: str) -> Array | None:
        values = [getattr(part, name) for part in parts]
        if all(v is None for v in values):
            return None
        absent = [np.full((len(p.positions), len(first.joints)), np.nan) for p in parts]
        filled: Array = np.concatenate([a if v is None else v for v, a in zip(values, absent, strict=True)])
        return filled[order]

    return JointStateColumns(
        joints=first.joints,
        positions=column("positions"),
        stamp_ns=column("stamp_ns"),
        log_ns=column("log_ns"),
        sequence=column("sequence"),
        position=numbers("position"),
        velocity=numbers("velocity"),
        effort=numbers("effort"),
    )


def _without_nan(
    path: Path, topic: str, name: str, joints: tuple[str, ...], values: Array | None, notes: list[str]
) -> Array | None:
    """A column of a foreign file: all NaN means absent, some NaN is an error with its place."""
    if values is None:
        notes.append(f"{topic} has no {name}")
        return None
    bad = ~np.isfinite(values)
    if bad.all():
        notes.append(f"{topic} has no {name}: all of it is NaN")
        return None
    if bad.any():
        row, column = (int(k) for k in np.argwhere(bad)[0])
        raise InputError(
            f"{path}, message {row + 1} on {topic}",
            f"{name} of {joints[column]} is {values[row, column]}",
            "cut that part out of the recording, or repair what published it",
        )
    return values


def _wrench_topics(file: McapFile) -> list[str]:
    """Topics of WrenchStamped in cdr, /wrench first."""
    found = [
        name
        for name, kind in file.topics().items()
        if kind in WRENCH_TYPES and all(c.message_encoding == "cdr" for c in file.channels_of(name))
    ]
    return sorted(found, key=lambda name: (name != WRENCH, name))


def _with_foreign_wrench(recording: Recording, file: McapFile, collected: _Collected) -> Recording:
    """With the wrench of the file's WrenchStamped topic, where there is one; its samples keep times of their own."""
    wrench_t, wrench = collected.wrench(recording.start_ns)
    if wrench_t is None or wrench is None:
        return recording
    topics = _wrench_topics(file)
    notes = recording.notes
    if len(topics) > 1:
        notes = (*notes, f"the wrench is that of {topics[0]}; {', '.join(topics[1:])} are left out")
    order = np.argsort(wrench_t, kind="stable")
    frame = collected.wrench_frame or None
    return replace(recording, wrench_t=wrench_t[order], wrench=wrench[order], wrench_frame=frame, notes=notes)


def _with_own_channels(
    recording: Recording, file: McapFile, collected: _Collected, stamp_ns: Nanoseconds, metadata: dict[str, str]
) -> Recording:
    command = collected.matching(COMMAND, stamp_ns)
    feedforward = collected.matching(FEEDFORWARD, stamp_ns)
    installation = attached_installation(file.attachments(), str(recording.path))
    wrench_t, wrench = collected.wrench(recording.start_ns)
    sensors = installation.wrench_sensor if installation else ()
    temperature, notes = of_thermometers(recording.joints, recording.temperature)
    return replace(
        recording,
        temperature=temperature,
        notes=(*recording.notes, *notes),
        q_d=None if command is None else command.position,
        dq_d=None if command is None else command.velocity,
        tau_command=None if command is None else command.effort,
        tau_ff=None if feedforward is None else feedforward.effort,
        wrench_t=wrench_t,
        wrench=wrench,
        wrench_frame=sensors[0].frame if sensors and wrench is not None else None,
        events=collected.events(recording.start_ns),
        arm=metadata.get("arm"),
        installation=installation,
        metadata=metadata,
    )


def _at_stamps(columns: JointStateColumns, stamp_ns: Nanoseconds) -> JointStateColumns:
    if np.array_equal(columns.stamp_ns, stamp_ns):
        return columns
    order = np.argsort(columns.stamp_ns, kind="stable")
    place = np.minimum(np.searchsorted(columns.stamp_ns[order], stamp_ns), len(order) - 1)
    rows, missing = order[place], columns.stamp_ns[order[place]] != stamp_ns

    def filled(values: Array | None) -> Array | None:
        return None if values is None else np.where(missing[:, None], np.nan, values[rows])

    return replace(
        columns,
        positions=columns.positions[rows],
        stamp_ns=stamp_ns,
        log_ns=columns.log_ns[rows],
        sequence=columns.sequence[rows],
        position=filled(columns.position),
        velocity=filled(columns.velocity),
        effort=filled(columns.effort),
    )
