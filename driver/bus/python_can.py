"""python-can on our channels: the plug-in ``etude_local`` for the local bus, and a bus for either kind of channel.

With the plug-in `canopen`, python-can's viewer and logger, and anything else made for python-can works on the
stand-in's bus: ``can.Bus(interface="etude_local", channel="dda-can0")``.
"""

from __future__ import annotations

import select
import time
from collections import deque
from pathlib import Path
from typing import Any

import can

from config.errors import InputError
from driver.bus.channel import RECEIVE_BYTES
from driver.bus.errors import ChannelFault, TransmitQueueFull
from driver.bus.frames import ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, FRAME_BYTES, REMOTE_FLAG, Mark, pack, unpack
from driver.bus.local import LocalChannel
from driver.bus.socketcan import SocketCanChannel


class LocalBus(can.BusABC):  # type: ignore[misc]
    """python-can bus on ``local:<channel>``; marks are kept from the user. One thread may send while another receives.

    Messages are stamped on arrival with the wall clock, in lockstep with the time of the last mark.
    Raises InputError like `open_channel`; failures in use are can.CanOperationError.
    """

    def __init__(self, channel: str, *, run_dir: Path | str | None = None, **kwargs: Any) -> None:
        self._is_shutdown = True  # Until there is something to shut down: BusABC's finaliser asks.
        self._channel = LocalChannel(str(channel), run_dir=Path(run_dir) if run_dir else None)
        self.channel_info = self._channel.spec
        self._buffer = bytearray(RECEIVE_BYTES)
        self._waiting: deque[can.Message] = deque()
        self._poll = select.poll()
        self._poll.register(self._channel.fileno(), select.POLLIN)
        self._is_shutdown = False
        super().__init__(channel=channel, **kwargs)

    @property
    def lockstep(self) -> bool:
        return self._channel.lockstep

    def fileno(self) -> int:
        return self._channel.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one classic CAN message; ``timeout`` bounds the waiting for room on the bus, by default none is done."""
        if msg.is_fd or msg.is_error_frame:
            raise can.CanOperationError(f"{self.channel_info} carries classic CAN data and remote frames only")
        flags = (EXTENDED_FLAG if msg.is_extended_id else 0) | (REMOTE_FLAG if msg.is_remote_frame else 0)
        frame = pack(msg.arbitration_id | flags, bytes(msg.data))
        deadline = time.monotonic() + (timeout or 0.0)
        while True:
            try:
                self._channel.send(frame)
            except TransmitQueueFull as fault:
                if time.monotonic() >= deadline:
                    raise can.CanOperationError(str(fault)) from None
                time.sleep(0.001)
            except ChannelFault as fault:
                raise can.CanOperationError(str(fault)) from None
            else:
                return

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._waiting:
            self._poll.poll(None if timeout is None else timeout * 1000.0)
            self._fetch()
        return (self._waiting.popleft() if self._waiting else None), False

    def _fetch(self) -> None:
        try:
            end = self._channel.drain(self._buffer)
        except ChannelFault as fault:
            raise can.CanOperationError(str(fault)) from None
        mark_ns = self._channel.mark_ns
        stamp = mark_ns * 1e-9 if mark_ns else time.time()
        for offset in range(0, end, FRAME_BYTES):
            try:
                frame = unpack(self._buffer, offset)
            except ValueError as error:
                raise can.CanOperationError(f"{self.channel_info}: {error}") from None
            if not isinstance(frame, Mark):
                self._waiting.append(_message(frame.can_id, frame.data, stamp, str(self.channel_info)))

    def shutdown(self) -> None:
        super().shutdown()
        self._channel.close()


def _message(can_id: int, data: bytes, stamp: float, channel: str) -> can.Message:
    remote = bool(can_id & REMOTE_FLAG)
    return can.Message(
        timestamp=stamp,
        arbitration_id=can_id & EXTENDED_MASK,
        is_extended_id=bool(can_id & EXTENDED_FLAG),
        is_remote_frame=remote,
        is_error_frame=bool(can_id & ERROR_FLAG),
        is_rx=True,
        dlc=len(data),
        data=None if remote else data,
        channel=channel,
    )


def python_can_bus(spec: str, *, run_dir: Path | None = None) -> can.BusABC:
    """A python-can bus on a channel as configured; raises InputError exactly as `open_channel` does."""
    kind, _, name = spec.partition(":")
    if kind == "local" and name:
        return LocalBus(name, run_dir=run_dir)
    if kind != "socketcan" or not name:
        raise InputError(f"channel {spec!r}", "is not a CAN channel", "write socketcan:<interface> or local:<path>")
    SocketCanChannel(name).close()  # It says in one sentence what python-can would say in a trace.
    try:
        bus: can.BusABC = can.Bus(interface="socketcan", channel=name)
    except (OSError, can.CanError) as error:
        raise InputError(spec, f"python-can cannot open it ({error})", f"look at `ip link show {name}`") from None
    return bus
