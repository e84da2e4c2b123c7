"""JointState messages to columns of numbers: the layout is read from one message, the numbers from all at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from driver.recording.message_records import RECORD_HEAD_BYTES, SECOND
from driver.recording.topic_messages import Bytes, Indices

Array = NDArray[np.float64]
BODY = RECORD_HEAD_BYTES + 4
"""Where the CDR body starts in a message record; alignment counts from here."""


@dataclass(frozen=True)
class JointStateColumns:
    """Messages with the same joints and the same filled fields. Arrays are messages × joints, absent ones None."""

    joints: tuple[str, ...]
    positions: Indices
    """Places of these messages among those that were given."""
    stamp_ns: NDArray[np.int64]
    log_ns: NDArray[np.int64]
    sequence: NDArray[np.int64]
    position: Array | None
    velocity: Array | None
    effort: Array | None


class NotJointState(ValueError):
    """A message's bytes are not a JointState in CDR; says why."""


def joint_state_columns(positions: Indices, rows: Bytes) -> Iterator[JointStateColumns]:
    """Decode message records of one length, given as rows. Raises `NotJointState`.

    Rows that differ from the first in what names the joints come in groups of their own.
    """
    left = np.arange(len(rows))
    while len(left):
        layout = _Layout(rows[left[0]])
        fixed = rows[left][:, layout.fixed]
        alike = np.all(fixed == fixed[0], axis=1)
        yield layout.columns(positions[left[alike]], rows[left[alike]])
        left = left[~alike]


class _Layout:
    """Where the fields of one JointState are, learnt from its bytes."""

    def __init__(self, row: Bytes) -> None:
        data = row.tobytes()
        encapsulation = data[RECORD_HEAD_BYTES:BODY]
        if len(data) < BODY + 8 or encapsulation[:1] != b"\0" or encapsulation[1] not in (0, 1):
            raise NotJointState(f"the encapsulation {encapsulation[:2].hex()} is not plain CDR")
        self._order = "<" if encapsulation[1] else ">"
        self._data, self._at = data, BODY + 8
        self._string()
        self.joints = tuple(self._string() for _ in range(self._count(5)))
        if len(set(self.joints)) != len(self.joints):
            raise NotJointState(f"a joint is named twice in {', '.join(self.joints)}")
        self.fixed = np.ones(len(data), dtype=bool)
        self.fixed[:BODY] = False
        self.fixed[BODY : BODY + 8] = False
        self._fields = [self._numbers(name) for name in ("position", "velocity", "effort")]

    def _count(self, least_bytes: int) -> int:
        self._at += -(self._at - BODY) % 4
        raw = self._data[self._at : self._at + 4]
        count = int.from_bytes(raw, "little" if self._order == "<" else "big")
        self._at += 4
        if len(raw) < 4 or self._at + count * least_bytes > len(self._data):
            raise NotJointState("it ends before its fields do")
        return count

    def _string(self) -> str:
        size = self._count(1)
        text = self._data[self._at : self._at + max(0, size - 1)]
        self._at += size
        return text.decode("utf-8", "replace")

    def _numbers(self, name: str) -> int | None:
        """Where a field's numbers start; None when it is empty."""
        count = self._count(8)
        if count == 0:
            return None
        if count != len(self.joints):
            raise NotJointState(f"{count} numbers of {name} for {len(self.joints)} joints")
        self._at += -(self._at - BODY) % 8
        start, self._at = self._at, self._at + 8 * count
        if self._at > len(self._data):
            raise NotJointState("it ends before its fields do")
        self.fixed[start : self._at] = False
        return start

    def columns(self, positions: Indices, rows: Bytes) -> JointStateColumns:
        def column(start: int, dtype: str, count: int) -> NDArray[np.generic]:
            size = np.dtype(dtype).itemsize * count
            return np.ascontiguousarray(rows[:, start : start + size]).view(dtype)

        def floats(start: int | None) -> Array | None:
            if start is None:
                return None
            return column(start, f"{self._order}f8", len(self.joints)).astype(np.float64)

        seconds = column(BODY, f"{self._order}i4", 1)[:, 0].astype(np.int64)
        nanoseconds = column(BODY + 4, f"{self._order}u4", 1)[:, 0].astype(np.int64)
        position, velocity, effort = (floats(start) for start in self._fields)
        return JointStateColumns(
            joints=self.joints,
            positions=positions,
            stamp_ns=seconds * SECOND + nanoseconds,
            log_ns=column(15, "<u8", 1)[:, 0].astype(np.int64),
            sequence=column(11, "<u4", 1)[:, 0].astype(np.int64),
            position=position,
            velocity=velocity,
            effort=effort,
        )
