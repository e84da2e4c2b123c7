"""Messages of a header and some numbers (WrenchStamped, Temperature) to columns, all at once."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.drive import COLDEST, HOTTEST
from driver.recording.message_records import RECORD_HEAD_BYTES, SECOND
from driver.recording.topic_messages import Batch, records_by_length

Array = NDArray[np.float64]
BODY = RECORD_HEAD_BYTES + 4
"""Where the CDR body starts in a message record."""


class NotStamped(ValueError):
    """A message's bytes are no header with so many numbers; says why."""


class StampedColumns(NamedTuple):
    """Messages of one frame: its name, stamps in ns, and (messages, numbers)."""

    frame: str
    stamp_ns: NDArray[np.int64]
    numbers: Array


def stamped_columns(batch: Batch, channel_id: int, count: int) -> Iterator[StampedColumns]:
    """The messages of a channel by frame and order of bytes: the stamp is at a body's start, ``count`` numbers at its
    end, however long the name between them is. Raises `NotStamped`."""
    for _, rows in records_by_length(batch, channel_id):
        least = BODY + 12 + 8 * count
        if rows.shape[1] < least:
            raise NotStamped(
                f"it has {rows.shape[1] - BODY} bytes, and a header with {count} numbers has {least - BODY}"
            )
        heads = np.column_stack([rows[:, RECORD_HEAD_BYTES + 1], rows[:, BODY + 8 : -8 * count]])
        alike, of_row = np.unique(heads, axis=0, return_inverse=True)
        for k, (little, *text) in enumerate(alike.tolist()):
            order = "<" if little else ">"
            (length,) = struct.unpack_from(f"{order}I", bytes(text))
            own = rows[of_row.ravel() == k]
            seconds = np.ascontiguousarray(own[:, BODY : BODY + 4]).view(f"{order}i4")[:, 0].astype(np.int64)
            nanoseconds = np.ascontiguousarray(own[:, BODY + 4 : BODY + 8]).view(f"{order}u4")[:, 0]
            numbers = np.ascontiguousarray(own[:, -8 * count :]).view(f"{order}f8").astype(np.float64)
            name = bytes(text[4 : 3 + length]).decode(errors="replace")
            yield StampedColumns(name, seconds * SECOND + nanoseconds, numbers)


def temperature_at(
    t: Array, start_ns: int, joints: Sequence[str], told: Mapping[str, Sequence[StampedColumns]]
) -> Array | None:
    """(samples, joints) °C at ``t`` s behind ``start_ns``, of the messages of each joint: between neighbouring ones,
    and as the nearest beyond them. NaN of joints without; None without any."""
    result = np.full((len(t), len(joints)), np.nan)
    for number, joint in enumerate(joints):
        parts = told.get(joint, ())
        if parts:
            stamp_ns = np.concatenate([part.stamp_ns for part in parts])
            celsius = np.concatenate([part.numbers[:, 0] for part in parts])
            order = np.argsort(stamp_ns, kind="stable")
            order = order[np.isfinite(celsius[order])]
            if len(order):
                result[:, number] = np.interp(t, (stamp_ns[order] - start_ns) / SECOND, celsius[order])
    return None if np.isnan(result).all() else result


def of_thermometers(joints: Sequence[str], whole: Array | None) -> tuple[Array | None, list[str]]:
    """The temperatures (samples, joints) of joints whose drives have a thermometer, and a note on each other: what a
    drive tells without one is often the end of its range."""
    notes: list[str] = []
    if whole is None:
        return None, notes
    wrong = (whole < COLDEST) | (whole > HOTTEST)
    for joint, own, beyond in zip(joints, whole.T, wrong.T, strict=True):
        if beyond.any():
            why = f"its drive tells {own[beyond][0]:.4g} °C, as one without a thermometer"
            notes.append(f"the temperature of {joint} is left out: {why}")
    kept = np.where(wrong.any(axis=0), np.nan, whole)
    return (None if np.isnan(kept).all() else kept), notes
