"""Any recording as arrays, by what the file is."""

from __future__ import annotations

from pathlib import Path

from config import InputError
from driver.recording.csv_recording import LeftOut, read_csv, write_csv
from driver.recording.mcap_recording import read_mcap
from driver.recording.recording import Recording
from driver.recording.run_writer import JOINT_STATES


def read_recording(path: Path | str, topic: str = JOINT_STATES) -> Recording:
    """Read our own recordings, any MCAP file with a JointState ``topic``, and CSV.

    Raises InputError naming the place: message, or line and column.
    """
    path = Path(path)
    if path.is_dir():
        inside = sorted(path.glob("*.mcap"))
        remedy = f"name {inside[0]}" if inside else "name an .mcap or .csv file"
        raise InputError(str(path), "is a directory", remedy)
    if not path.exists():
        raise InputError(str(path), "there is no such file", "check the path")
    if not path.is_file():
        # A pipe or a device may never end, and a client of the daemon may name one.
        raise InputError(str(path), "is no file", "name an .mcap or .csv file")
    return read_csv(path) if path.suffix.lower() in (".csv", ".txt") else read_mcap(path, topic)


def export(path: Path | str, output: Path | str, topic: str = JOINT_STATES) -> LeftOut:
    """Write a recording as CSV; returns what of it was left out."""
    return write_csv(read_recording(path, topic), Path(output))
