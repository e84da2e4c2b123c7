"""Start-up writes of a joint's drive as raw integers, checked against the ranges of its EDS."""

from __future__ import annotations

from math import pi

from config.eds_check import raw_range, read_eds, variable_at
from config.errors import InputError
from config.schema import Installation, Joint, Quantity, SdoWrite


def quantity(joint: Joint, key: Quantity) -> float:
    """A start-up quantity of ``joint``: N·m/rad, N·m·s/rad, ‰ of rated torque, counts/s or counts.

    Where the encoder counts backwards the lower position limit in counts is the upper one of the joint.
    """
    counts_per_rad = joint.encoder.sign * joint.encoder.counts_per_turn / (2 * pi)
    low, high = sorted((q - joint.encoder.zero_rad) * counts_per_rad for q in joint.limits.position_rad)
    return {
        "servo_stiffness": joint.servo.stiffness_nm_rad,
        "servo_damping": joint.servo.damping_nms_rad,
        "torque_limit": 1000 * joint.limits.torque_nm / joint.rated_torque_nm,
        "velocity_limit": joint.limits.velocity_rad_s * abs(counts_per_rad),
        "position_low": low,
        "position_high": high,
        "following_error": joint.limits.following_error_rad * abs(counts_per_rad),
    }[key]


def raw_value(joint: Joint, write: SdoWrite) -> int:
    """The integer that ``write`` puts into the drive of ``joint``."""
    if write.from_key is not None:
        return round(write.scale * quantity(joint, write.from_key))
    assert write.value is not None  # SdoWrite has one of the two
    return write.value


def check_start_up(installation: Installation, place: str) -> None:
    """Raise InputError for a joint whose settings its drive cannot take."""
    for k, joint in enumerate(installation.joint):
        drive = installation.drive_of(joint)
        dictionary = read_eds(drive.eds)
        for write in drive.start_up:
            low, high = raw_range(variable_at(dictionary, write.index, write.subindex))
            raw = raw_value(joint, write)
            if not low <= raw <= high:
                what = write.from_key or "value"
                raise InputError(
                    f"{place}: joint[{k}] ({joint.name})",
                    f"{what} becomes {raw} in object {write.index:04X}:{write.subindex:02X} of {drive.name}, "
                    f"which takes {low} to {high}",
                    "correct the joint's settings or the drive's scale",
                )
