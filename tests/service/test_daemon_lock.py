"""One daemon an arm; readiness and watchdog as systemd wants them."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from config import InputError
from service.daemon.lock import ArmLock
from service.daemon.systemd import notify, watchdog_interval_s


def test_the_second_daemon_is_told_who_has_the_arm(tmp_path: Path) -> None:
    first = ArmLock(tmp_path, "dda")
    with pytest.raises(InputError, match=f"process {os.getpid()}"):
        ArmLock(tmp_path, "dda")
    ArmLock(tmp_path, "puma600").release()
    first.release()
    ArmLock(tmp_path, "dda").release()


def test_a_lock_left_by_a_dead_daemon_does_not_bind(tmp_path: Path) -> None:
    (tmp_path / "dda.lock").write_text("99999\n")
    lock = ArmLock(tmp_path, "dda")
    assert lock.path.read_text() == f"{os.getpid()}\n"
    lock.release()


@pytest.mark.parametrize("abstract", [False, True])
def test_the_manager_is_notified(abstract: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("" if abstract else str(tmp_path / "notify"))
        name = manager.getsockname()
        monkeypatch.setenv("NOTIFY_SOCKET", "@" + name[1:].decode() if abstract else name)
        assert notify("READY=1", "STATUS=serving")
        assert manager.recv(100) == b"READY=1\nSTATUS=serving"


def test_nobody_to_notify_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    assert not notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "gone"))
    assert not notify("READY=1")


def test_the_watchdog_is_ours_only_when_it_is_meant_for_us(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WATCHDOG_USEC", raising=False)
    assert watchdog_interval_s() is None
    monkeypatch.setenv("WATCHDOG_USEC", "3000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    assert watchdog_interval_s() == 3.0
    monkeypatch.setenv("WATCHDOG_PID", "1")
    assert watchdog_interval_s() is None
