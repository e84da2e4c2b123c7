"""A recording's outline, read from its summary alone: a list of many recordings must not read them all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from driver.recording.mcap_records import UNREADABLE

JOINT_STATES = "/joint_states"


def summarise(path: Path) -> dict[str, Any]:
    """Path, size, length in seconds, joint samples; ``complete`` is False, and the figures None, for a cut file."""
    outline: dict[str, Any] = {"path": str(path), "bytes": 0, "seconds": None, "samples": None, "complete": False}
    if not path.is_file():
        return outline
    outline["bytes"] = path.stat().st_size
    with path.open("rb") as stream:
        try:
            summary = make_reader(stream).get_summary()
        except UNREADABLE:
            return outline
    if summary is None or summary.statistics is None:
        return outline
    statistics = summary.statistics
    outline["complete"] = True
    outline["seconds"] = (statistics.message_end_time - statistics.message_start_time) / 1e9
    for number, channel in summary.channels.items():
        if channel.topic == JOINT_STATES:
            outline["samples"] = statistics.channel_message_counts.get(number, 0)
    return outline
