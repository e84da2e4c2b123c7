"""Where things live at run time: sockets and locks in one directory, recordings and models in another."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from config.errors import InputError

_SHARED = Path("/tmp")
MODE = 0o750
"""Group members may enter and read; nobody else."""


def run_directory() -> Path:
    """Directory of sockets, pty links and locks, made if absent (mode 0750).

    ``$ETUDE_RUN``, else ``/run/etude`` when this user may write it, else ``$XDG_RUNTIME_DIR/etude``,
    else ``/tmp/etude-<uid>``. Raises InputError when it cannot be made, or when a shared place holds
    a directory of that name that belongs to somebody else.
    """
    if chosen := os.environ.get("ETUDE_RUN"):
        return _made(Path(chosen), "set ETUDE_RUN to a directory that this user can write")
    if _writable(Path("/run/etude")):
        return Path("/run/etude")
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return _made(Path(session) / "etude", "set ETUDE_RUN to a directory that this user can write")
    path = _made(_SHARED / f"etude-{os.getuid()}", "set ETUDE_RUN to a directory that this user can write")
    if path.is_symlink() or path.stat().st_uid != os.getuid() or path.stat().st_mode & stat.S_IWOTH:
        raise InputError(str(path), "belongs to another user or is open to all", "remove it, or set ETUDE_RUN")
    return path


def state_directory() -> Path:
    """Directory of recordings, models and sessions, made if absent (mode 0750).

    ``$ETUDE_STATE``, else ``/var/lib/etude`` when this user may write it, else ``$XDG_STATE_HOME/etude``,
    else ``~/.local/state/etude``. Raises InputError when it cannot be made.
    """
    remedy = "set ETUDE_STATE to a directory that this user can write"
    if chosen := os.environ.get("ETUDE_STATE"):
        return _made(Path(chosen), remedy)
    if _writable(Path("/var/lib/etude")):
        return Path("/var/lib/etude")
    if home := os.environ.get("XDG_STATE_HOME"):
        return _made(Path(home) / "etude", remedy)
    try:
        return _made(Path.home() / ".local" / "state" / "etude", remedy)
    except RuntimeError:
        raise InputError("$HOME", "is not set and this user has no home directory", remedy) from None


def _writable(path: Path) -> bool:
    return path.is_dir() and os.access(path, os.W_OK | os.X_OK)


def _made(path: Path, remedy: str) -> Path:
    path = path.expanduser().absolute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=MODE, exist_ok=True)
    except OSError as error:
        raise InputError(str(path), f"cannot be made ({error.strerror})", remedy) from None
    if not _writable(path):
        raise InputError(str(path), "cannot be written by this user", remedy)
    return path
