"""An MCAP file as a `Recording`: our own, and any other with a JointState topic."""

from __future__ import annotations

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
from driver.recording.topic_messages import McapFile, records_by_length

JOINT_STATE_TYPES = (ros2.JOINT_STATE, "sensor_msgs/JointState")
WRENCH = "/wrench"
Nanoseconds = NDArray[np.int64]


def read_mcap(path: Path, topic: str = JOINT_STATES) -> Recording:
    """Read the recording whose measured joints are on ``topic``.

    Raises InputError: no such topic, another type, no messages, unequal clocks, NaN (foreign files), damage.
    """
    with McapFile(path) as file:
        metadata = next((m.metadata for m in file.metadata() if m.name == METADATA), None)
        own = metadata is not None
        measured, notes = _joint_states(file, topic)
        stamp_ns = measured.stamp_ns
        if not stamp_ns.any():
            stamp_ns = measured.log_ns
            notes.append(f"{topic} has no time stamps: the time of logging is used")
        check_increasing(stamp_ns, f"{path}, message on {topic}, number")
        start_ns = int(stamp_ns[0])
        t: Array = (stamp_ns - start_ns) / SECOND
        if measured.position is None:
            raise InputError(f"{path}, {topic}", "has no positions", "record joint positions in rad")
        columns = {"position": measured.position, "velocity": measured.velocity, "effort": measured.effort}
        if not own:
            columns = {
                name: _without_nan(path, topic, name, measured.joints, values, notes)
                for name, values in columns.items()
            }
        gaps = find_gaps(t)
        position = columns["position"]
        if position is None:
            raise InputError(f"{path}, {topic}", "has no positions but NaN", "record joint positions in rad")
        recording = Recording(
            path=path,
            joints=measured.joints,
            start_ns=start_ns,
            t=t,
            q=position,
            dq=columns["velocity"],
            tau=columns["effort"],
            gaps=gaps,
            notes=(*notes, *gap_notes(gaps)),
        )
        return _with_own_channels(recording, file, stamp_ns, metadata) if metadata is not None else recording


def _joint_states(file: McapFile, topic: str) -> tuple[JointStateColumns, list[str]]:
    """All messages on ``topic`` in the order of their log times, of the set of joints that most of them have."""
    groups: dict[tuple[str, ...], list[JointStateColumns]] = {}
    channels = _checked_channels(file, topic)
    for batch in file.batches(frozenset(channels)):
        for channel_id in channels:
            for positions, rows in records_by_length(batch, channel_id):
                try:
                    for part in joint_state_columns(positions, rows):
                        groups.setdefault(part.joints, []).append(part)
                except NotJointState as error:
                    place = f"{file.path}, {topic}"
                    raise InputError(place, f"a message is no JointState: {error}", "check what publishes it") from None
    if not groups:
        raise InputError(f"{file.path}, {topic}", "has no messages", "name another topic with --topic")
    sizes = {joints: sum(len(part.positions) for part in parts) for joints, parts in groups.items()}
    joints = max(sizes, key=lambda names: (sizes[names], len(names)))
    notes = [
        f"{count} messages on {topic} of other joints ({', '.join(names) or 'none'}) are left out"
        for names, count in sizes.items()
        if names != joints
    ]
    return _joined(groups[joints]), notes


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


def _with_own_channels(
    recording: Recording, file: McapFile, stamp_ns: Nanoseconds, metadata: dict[str, str]
) -> Recording:
    command = _matching(file, COMMAND, stamp_ns)
    feedforward = _matching(file, FEEDFORWARD, stamp_ns)
    installation = attached_installation(file.attachments(), str(recording.path))
    wrench_t, wrench = _wrench(file, recording.start_ns)
    sensors = installation.wrench_sensor if installation else ()
    fields = dict(vars(recording))
    fields.update(
        q_d=command and command.position,
        dq_d=command and command.velocity,
        tau_command=command and command.effort,
        tau_ff=feedforward and feedforward.effort,
        wrench_t=wrench_t,
        wrench=wrench,
        wrench_frame=sensors[0].frame if sensors and wrench is not None else None,
        events=_events(file, recording.start_ns),
        arm=metadata.get("arm"),
        installation=installation,
        metadata=metadata,
    )
    return Recording(**fields)


def _matching(file: McapFile, topic: str, stamp_ns: Nanoseconds) -> JointStateColumns | None:
    """The messages of ``topic`` at the given stamps, NaN where there is none; None without the topic."""
    if not file.channels_of(topic):
        return None
    columns, _ = _joint_states(file, topic)
    if np.array_equal(columns.stamp_ns, stamp_ns):
        return columns
    order = np.argsort(columns.stamp_ns, kind="stable")
    place = np.minimum(np.searchsorted(columns.stamp_ns[order], stamp_ns), len(order) - 1)
    rows, missing = order[place], columns.stamp_ns[order[place]] != stamp_ns

    def at_stamps(values: Array | None) -> Array | None:
        return None if values is None else np.where(missing[:, None], np.nan, values[rows])

    return JointStateColumns(
        joints=columns.joints,
        positions=columns.positions[rows],
        stamp_ns=stamp_ns,
        log_ns=columns.log_ns[rows],
        sequence=columns.sequence[rows],
        position=at_stamps(columns.position),
        velocity=at_stamps(columns.velocity),
        effort=at_stamps(columns.effort),
    )


def _wrench(file: McapFile, start_ns: int) -> tuple[Array | None, Array | None]:
    """(times, samples × 6) of /wrench: the stamp is at the body's start, the six numbers at its end."""
    stamps, values = list[Nanoseconds](), list[Array]()
    channels = [channel.id for channel in file.channels_of(WRENCH)]
    for batch in file.batches(frozenset(channels)) if channels else ():
        for channel_id in channels:
            for _, rows in records_by_length(batch, channel_id):
                body = RECORD_HEAD_BYTES + 4
                seconds = np.ascontiguousarray(rows[:, body : body + 4]).view("<i4")[:, 0].astype(np.int64)
                nanoseconds = np.ascontiguousarray(rows[:, body + 4 : body + 8]).view("<u4")[:, 0]
                stamps.append(seconds * SECOND + nanoseconds)
                values.append(np.ascontiguousarray(rows[:, -48:]).view("<f8").astype(np.float64))
    if not stamps:
        return None, None
    return (np.concatenate(stamps) - start_ns) / SECOND, np.concatenate(values)


def _events(file: McapFile, start_ns: int) -> tuple[Event, ...]:
    events = []
    channels = [channel.id for channel in file.channels_of(EVENTS)]
    for batch in file.batches(frozenset(channels)) if channels else ():
        for channel_id in channels:
            for place in batch.offsets.get(channel_id, ()):
                start = int(place)
                end = start + 9 + int.from_bytes(batch.data[start + 1 : start + 9].tobytes(), "little")
                record = batch.data[start:end].tobytes()
                level, text = LogRecord.unpack(record[RECORD_HEAD_BYTES:])
                log_ns = int.from_bytes(record[15:23], "little")
                events.append(Event((log_ns - start_ns) / SECOND, level, text))
    return tuple(sorted(events, key=lambda event: event.t))
