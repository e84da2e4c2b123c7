"""Decodes the raw channels of a recording again, by the code that decoded them live, and compares."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from mcap.records import Channel

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.pdo import SYNC, PdoCodec
from driver.cia402.temperatures import TemperatureInput
from driver.recording.installation_attachments import attached_installation
from driver.recording.message_records import (
    NO_WRENCH,
    RECORD_HEAD_BYTES,
    BytesRecord,
    CanFrameRecord,
    JointStateRecord,
    TemperatureRecord,
    WrenchRecord,
)
from driver.recording.run_writer import (
    JOINT_STATES,
    METADATA,
    can_topics,
    serial_topics,
    temperature_topics,
    wrench_topics,
)
from driver.recording.topic_messages import McapFile
from driver.wrench import make_parser


@dataclass(frozen=True)
class Difference:
    """The first message of a topic that replay makes otherwise; either is None where there is none."""

    topic: str
    message: int
    recorded: bytes | None
    replayed: bytes | None


@dataclass
class ReplayReport:
    """What replay of one recording gave. ``messages``: how many were made again, by topic."""

    path: Path
    messages: dict[str, int] = field(default_factory=dict)
    differences: list[Difference] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        """Every decoded message came out again, byte for byte."""
        return not self.differences

    @property
    def sentence(self) -> str:
        made = ", ".join(f"{count} messages on {topic}" for topic, count in self.messages.items())
        if self.identical:
            return f"{self.path}: the raw channels give the decoded ones again, byte for byte ({made})"
        first = self.differences[0]
        return f"{self.path}: {first.topic} differs from its raw channel, first in message {first.message}"


def replay(path: Path | str) -> ReplayReport:
    """Decode /can/… and /serial/… of our own recording and compare with /joint_states, /temperature/… and /wrench.

    Raises InputError for a recording without raw channels or without its installation, and for a damaged one.
    """
    path = Path(path)
    with McapFile(path) as file:
        installation = attached_installation(file.attachments(), str(path))
        if installation is None:
            raise InputError(str(path), "does not carry the installation it was made with", "replay our own recordings")
        metadata = next((m.metadata for m in file.metadata() if m.name == METADATA), {})
        report = ReplayReport(path)
        channels = {channel.topic: channel for channel in file.channels.values()}
        _compare(
            file, JOINT_STATES, _joint_states(file, installation, channels, metadata.get("mode")), report, channels
        )
        for topic, records in _temperatures(file, installation, channels).items():
            _compare(file, topic, iter(records), report, channels)
        for number, topic in enumerate(wrench_topics(installation)):
            _compare(file, topic, _wrench(file, installation, number, channels), report, channels)
        return report


def _records(file: McapFile, wanted: dict[int, int]) -> Iterator[tuple[int, int, int, bytes]]:
    """(sequence, log time, value of ``wanted``, record) of the wanted channels' messages, in the file's order."""
    for batch in file.batches(frozenset(wanted)):
        places = sorted((int(at), channel_id) for channel_id, found in batch.offsets.items() for at in found)
        data = batch.data.data
        for at, channel_id in places:
            end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
            record = bytes(data[at:end])
            log_ns = int.from_bytes(record[15:23], "little")
            yield int.from_bytes(record[11:15], "little"), log_ns, wanted[channel_id], record


def _codec(installation: Installation, mode: str | None, path: Path) -> PdoCodec:
    """The codec of the recorded mode; where the recording does not say, all modes must measure alike."""
    chosen: list[Mode] = [m for m in installation.modes if mode in (m, None)]
    codecs = [PdoCodec(installation, m) for m in chosen]
    if not codecs:
        raise InputError(str(path), f"was made in mode {mode!r}, which its installation has not", "check its metadata")
    layouts = {tuple(pdo for maps in codec.maps for pdo in maps if not pdo.receive) for codec in codecs}
    if len(layouts) > 1:
        raise InputError(str(path), "does not say in which mode it was made", "record with `mode` in the metadata")
    return codecs[0]


def _joint_states(
    file: McapFile, installation: Installation, channels: dict[str, Channel], mode: str | None
) -> Iterator[bytes]:
    """/joint_states from the frames of each cycle: a joint whose feedback did not come is NaN.

    Cycles before the run's first are decoded for what the codec remembers of them.
    """
    buses = _raw_channels(file, installation, channels)
    codec = _codec(installation, mode, file.path)
    record = JointStateRecord(channels[JOINT_STATES].id, installation.joint_names, (True, True, True))
    # The message itself is among them: a cycle without any frame is a cycle all the same, one without it is none.
    wanted = buses | {channels[JOINT_STATES].id: -1}
    for (sequence, log_ns), cycle in groupby(_records(file, wanted), key=itemgetter(0, 1)):
        codec.begin_cycle(log_ns)
        recorded = False
        for _, _, bus, frame in cycle:
            if bus < 0:
                recorded = True
                continue
            sent, _, data = CanFrameRecord.unpack(frame[RECORD_HEAD_BYTES:])
            if not sent:
                codec.receive(bus, data, len(data))
            elif data == SYNC:
                # What came before the cycle's SYNC is late feedback of the cycle before: recorded, never used.
                codec.begin_cycle(log_ns)
        measured = codec.feedback()
        if recorded:
            yield record.pack(sequence, log_ns, log_ns, measured.q, measured.dq, measured.tau)


def _raw_channels(file: McapFile, installation: Installation, channels: dict[str, Channel]) -> dict[int, int]:
    """Numbers of the buses, by the channels of their frames. InputError when one is missing."""
    topics = can_topics(installation)
    if missing := [topic for topic in topics if topic not in channels]:
        raise InputError(str(file.path), f"has no raw channel {missing[0]}", "replay our own recordings")
    return {channels[topic].id: bus for bus, topic in enumerate(topics)}


def _temperatures(file: McapFile, installation: Installation, channels: dict[str, Channel]) -> dict[str, list[bytes]]:
    """What the drives told of their temperatures, from the frames, by topic: seldom enough to be held."""
    topics, temperatures = temperature_topics(installation), TemperatureInput(installation)
    found: dict[str, list[bytes]] = {topic: [] for topic in topics.values()}
    first = _first_cycle_ns(file, channels) if topics else None
    if first is None:
        return found
    records = {k: TemperatureRecord(channels[topic].id, installation.joint[k].name) for k, topic in topics.items()}
    for sequence, log_ns, bus, frame in _records(file, _raw_channels(file, installation, channels)):
        sent, stamp_ns, data = CanFrameRecord.unpack(frame[RECORD_HEAD_BYTES:])
        warmth = None if sent or log_ns < first else temperatures.read(bus, data)
        if warmth is not None:
            record = records[warmth.joint]
            found[topics[warmth.joint]].append(record.pack(sequence, log_ns, stamp_ns, warmth.celsius))
    return found


def _first_cycle_ns(file: McapFile, channels: dict[str, Channel]) -> int | None:
    """Log time of the run's first cycle; None of a run that was ended before it."""
    first = next(_records(file, {channels[JOINT_STATES].id: 0}), None)
    return None if first is None else first[1]


def _wrench(file: McapFile, installation: Installation, number: int, channels: dict[str, Channel]) -> Iterator[bytes]:
    """One sensor's samples from the bytes of its line."""
    sensor = installation.wrench_sensor[number]
    topic = serial_topics(installation)[number]
    if topic not in channels:
        raise InputError(str(file.path), f"has no raw channel {topic}", "replay our own recordings")
    parser = make_parser(sensor)
    first = _first_cycle_ns(file, channels)
    if first is None:
        return
    record = WrenchRecord(channels[wrench_topics(installation)[number]].id, sensor.frame)
    for sequence, log_ns, _, raw in _records(file, {channels[topic].id: number}):
        samples = parser.feed(BytesRecord.unpack(raw[RECORD_HEAD_BYTES:]), log_ns)
        for sample in samples if log_ns >= first else ():
            yield record.pack(sequence, log_ns, sample.stamp_ns, sample.values if sample.fresh else NO_WRENCH)


def _compare(
    file: McapFile, topic: str, replayed: Iterator[bytes], report: ReplayReport, channels: dict[str, Channel]
) -> None:
    recorded = (record for _, _, _, record in _records(file, {channels[topic].id: 0}))
    count = 0
    while True:
        old, new = next(recorded, None), next(replayed, None)
        if old is None and new is None:
            break
        count += 1
        if old != new:
            report.differences.append(Difference(topic, count, old, new))
            break
    report.messages[topic] = count
