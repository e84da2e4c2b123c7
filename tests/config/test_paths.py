"""Run and state directories: where they are, and what is refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from config import InputError, paths


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ETUDE_RUN", "ETUDE_STATE", "XDG_RUNTIME_DIR", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(paths, "_writable", lambda path: _is_own(path))


def _is_own(path: Path) -> bool:
    """As for a user to whom no system directory belongs, whoever runs the tests."""
    system = path in (Path("/run/etude"), Path("/var/lib/etude"))
    return not system and path.is_dir() and os.access(path, os.W_OK | os.X_OK)


@pytest.mark.parametrize(
    ("directory", "chosen", "usual"),
    [
        (paths.run_directory, "ETUDE_RUN", "XDG_RUNTIME_DIR"),
        (paths.state_directory, "ETUDE_STATE", "XDG_STATE_HOME"),
    ],
)
def test_order_of_places(
    directory: Callable[[], Path], chosen: str, usual: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(usual, str(tmp_path / "usual"))
    assert directory() == tmp_path / "usual" / "etude"
    monkeypatch.setenv(chosen, str(tmp_path / "deep" / "chosen"))
    assert directory() == tmp_path / "deep" / "chosen"
    assert directory().stat().st_mode & 0o777 == 0o750 & ~_umask()


def test_home_is_the_last_place_for_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert paths.state_directory() == tmp_path / ".local" / "state" / "etude"


def test_a_file_in_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"file: cannot be made \(File exists\); set ETUDE_RUN to a directory"):
        paths.run_directory()


def test_a_directory_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path))
    monkeypatch.setattr(paths, "_writable", lambda path: False)
    with pytest.raises(InputError, match="cannot be written by this user; set ETUDE_STATE"):
        paths.state_directory()


def test_a_shared_place_is_not_trusted_blindly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In /tmp somebody else may have made the directory first, or left it open to all."""
    monkeypatch.setattr(paths, "_SHARED", tmp_path)
    made = paths.run_directory()
    assert made == tmp_path / f"etude-{os.getuid()}"
    made.chmod(0o777)
    with pytest.raises(InputError, match="belongs to another user or is open to all; remove it"):
        paths.run_directory()
    made.rmdir()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    made.symlink_to(elsewhere)
    with pytest.raises(InputError, match="belongs to another user"):
        paths.run_directory()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
