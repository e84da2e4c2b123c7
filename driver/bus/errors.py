"""What can go wrong on an open channel, and CAN error frames in words (linux/can/error.h)."""

from __future__ import annotations

from dataclasses import dataclass

from driver.bus.frames import ERROR_FLAG, Frame


class ChannelFault(Exception):
    """The bus failed while in use; the message is one sentence naming the channel and what to do."""


class TransmitQueueFull(ChannelFault):
    """Frames were not accepted: nobody acknowledges on the bus, or more is sent than it carries."""


class ChannelClosed(ChannelFault):
    """The other end is gone: the interface went down, or the stand-in ended."""


class MarkTimeout(ChannelFault):
    """The stand-in did not reach the wanted time."""


_CLASSES = (
    (0x001, "transmission timed out"),
    (0x002, "arbitration lost"),
    (0x008, "protocol violation"),
    (0x010, "transceiver fault: check wiring, supply and termination"),
    (0x020, "no acknowledgement: no other node is on the bus, powered and at this bit rate"),
    (0x040, "bus-off: the controller has left the bus after too many errors; check wiring, termination and bit rate"),
    (0x080, "bus error"),
    (0x100, "controller restarted"),
)
_CONTROLLER = (
    (0x01, "receive buffer of the controller overflowed: frames are lost"),
    (0x02, "transmit buffer of the controller overflowed: frames are lost"),
    (0x04, "receive errors reached the warning level"),
    (0x08, "transmit errors reached the warning level"),
    (0x10, "error passive by receive errors"),
    (0x20, "error passive by transmit errors: check wiring, termination and bit rate"),
    (0x40, "error active again"),
)
_BUS_OFF, _CONTROLLER_CLASS = 0x040, 0x004


@dataclass(frozen=True, slots=True)
class BusError:
    """One error frame: ``words`` for a person; ``bus_off`` and ``frames_lost`` are for the loop to act on."""

    words: str
    bus_off: bool
    frames_lost: bool


def decode_error_frame(frame: Frame) -> BusError:
    """An error frame in words. Raises ValueError for a frame that is none."""
    if not frame.can_id & ERROR_FLAG:
        raise ValueError(f"0x{frame.can_id:X} is no error frame")
    detail = frame.data[1] if len(frame.data) > 1 else 0
    words = [text for bit, text in _CLASSES if frame.can_id & bit]
    lost = False
    if frame.can_id & _CONTROLLER_CLASS:
        words += [text for bit, text in _CONTROLLER if detail & bit] or ["controller problem"]
        lost = bool(detail & 0x03)
    return BusError("; ".join(words) or f"error class 0x{frame.can_id:X}", bool(frame.can_id & _BUS_OFF), lost)
