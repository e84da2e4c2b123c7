"""A text file that somebody names: read whole, when it is a file and not without end."""

from __future__ import annotations

import stat
from pathlib import Path

LARGEST_BYTES = 64 << 20
"""More than any file of ours; a practised motion's torques are some megabytes."""


def read_text(path: Path) -> str:
    """The file's text. Paths come from clients too, so a pipe (which may never end, or never begin), a device and
    a path that cannot be one are refused as OSError; UnicodeDecodeError when it is not UTF-8. The mark that some
    editors put before UTF-8 is no part of the text."""
    try:
        found = path.stat()
    except ValueError as error:  # a zero byte, half a surrogate
        raise OSError(0, f"no path can be so written: {error}") from None
    if not stat.S_ISREG(found.st_mode):
        raise OSError(0, "it is no file")
    if found.st_size > LARGEST_BYTES:
        raise OSError(0, f"it has more than {LARGEST_BYTES >> 20} MB")
    return path.read_text(encoding="utf-8-sig")
