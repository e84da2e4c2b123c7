"""The stand-in arm and the cyclic loop for a benchmark, in a run directory of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from config import Installation, load_installation
from driver.arm import ArmLoop


@contextmanager
def running(arm: str, *, lockstep: bool) -> Iterator[tuple[Installation, ArmLoop, str]]:
    """The commissioned arm ``arm``: its installation, the handle of its loop, and the ring's name."""
    with tempfile.TemporaryDirectory(prefix="etude-") as folder:
        os.environ["ETUDE_RUN"] = folder
        installation = load_installation(arm)
        command = [sys.executable, "-m", "service", "virtual", "--config", str(installation.path)]
        standin = subprocess.Popen(command + (["--lockstep"] if lockstep else []))
        try:
            socket = Path(folder) / installation.bus[0].channel.partition(":")[2]
            deadline = time.monotonic() + 30
            while not socket.exists():
                if standin.poll() is not None or time.monotonic() > deadline:
                    raise RuntimeError(f"the stand-in for {arm} did not come up")
                time.sleep(0.05)
            ring = f"etude-bench-{os.getpid()}"
            with ArmLoop.start(installation, lockstep=lockstep, ring_name=ring) as loop:
                yield installation, loop, ring
        finally:
            standin.terminate()
            standin.wait(10)
