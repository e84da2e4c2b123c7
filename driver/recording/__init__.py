"""Recordings: one MCAP file a run, written beside the loop; read, recovered, replayed, exported; foreign files too."""

from driver.recording.process import RecorderProcess, RecorderStatus
from driver.recording.run_writer import RunWriter

__all__ = [
    "RecorderProcess",
    "RecorderStatus",
    "RunWriter",
]
