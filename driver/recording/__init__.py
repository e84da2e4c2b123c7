"""Recordings: one MCAP file a run, written beside the loop; read, recovered, replayed, exported; foreign files too."""

from driver.recording.made_with import arm_made_with
from driver.recording.process import RecorderProcess
from driver.recording.reader import export, read_recording
from driver.recording.recorder import RecorderStatus
from driver.recording.recording import Event, Gap, Recording
from driver.recording.recovery import RecoveryReport, recover
from driver.recording.replay import ReplayReport, replay
from driver.recording.run_writer import RunWriter

__all__ = [
    "Event",
    "Gap",
    "RecorderProcess",
    "RecorderStatus",
    "Recording",
    "RecoveryReport",
    "ReplayReport",
    "RunWriter",
    "arm_made_with",
    "export",
    "read_recording",
    "recover",
    "replay",
]
