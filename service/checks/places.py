"""Where Étude writes, and who may: directories, the group, room on the disk."""

from __future__ import annotations

import grp
import os
import shutil
from collections.abc import Iterator

from config import InputError, Installation
from config.paths import run_directory, state_directory
from service.checks.finding import Finding
from service.daemon.protocol import control_socket
from service.daemon.server import GROUP

AREA = "places"
ROOM_BYTES = 1 << 30


def check_places(installation: Installation) -> Iterator[Finding]:
    """Run and state directories, the length of the socket's path, the group that may move the arm."""
    for subject, directory in (("run directory", run_directory), ("state directory", state_directory)):
        try:
            path = directory()
            if subject == "run directory":
                control_socket(path, installation.arm.name)
        except InputError as error:
            yield Finding(AREA, subject, "fail", f"{error.place}: {error.problem}", error.remedy)
            continue
        room = shutil.disk_usage(path).free
        if subject == "state directory" and room < ROOM_BYTES:
            yield Finding(AREA, subject, "warn", f"{path}: {room / 1e6:.0f} MB are left", "make room for recordings")
        else:
            yield Finding(AREA, subject, "ok", str(path))
    try:
        group = grp.getgrnam(GROUP)
    except KeyError:
        yield Finding(
            AREA, "group", "warn", f"there is no group {GROUP}: only the daemon's own user may move the arm",
            f"groupadd --system {GROUP}, and add the operators",
        )  # fmt: skip
        return
    if os.getuid() == 0 or group.gr_gid in os.getgroups():
        yield Finding(AREA, "group", "ok", f"this user may move the arm ({GROUP})")
    else:
        yield Finding(
            AREA, "group", "warn", f"this user is not in {GROUP}: it may look only", f"usermod -aG {GROUP} USER"
        )
