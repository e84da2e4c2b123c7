"""A test that fails with a stopped process half-way leaves nothing running."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
FAILS = """
import os, signal, subprocess, sys
from pathlib import Path
def test_fails_half_way():
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
    Path(os.environ["LEFT"]).write_text(str(child.pid))
    os.kill(child.pid, signal.SIGSTOP)
    raise AssertionError("half-way")
"""


def test_a_failing_test_leaves_no_process(tmp_path: Path) -> None:
    folder = tmp_path / "tests"
    folder.mkdir()
    (folder / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text())
    (folder / "test_half_way.py").write_text(FAILS)
    left = tmp_path / "left"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(folder)],
        env={**os.environ, "LEFT": str(left), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 1 and "half-way" in done.stdout
    pid = int(left.read_text())
    state = Path(f"/proc/{pid}/stat")
    # Its parent has ended: killed it is gone, or waits for init to see that it is.
    assert not state.exists() or state.read_text().rpartition(")")[2].split()[0] in "ZX"
    assert "killed a process that a test has left" in done.stderr + done.stdout
