"""The installation inside its recordings: the files a person wrote, and one resolved file that a program reads back."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from mcap.records import Attachment
from pydantic import ValidationError

from config import InputError, Installation

RESOLVED = "installation.json"


def installation_attachments(installation: Installation, log_ns: int) -> list[Attachment]:
    """Installation file, URDF and the resolved configuration, stamped ``log_ns``.

    Raises InputError when the installation's files are no longer there.
    """
    urdf = installation.path.parent / installation.arm.urdf
    attachments = [_attachment(RESOLVED, "application/json", _resolved(installation).encode(), log_ns)]
    for path, media_type in ((installation.path, "application/toml"), (urdf, "application/xml")):
        try:
            data = path.read_bytes()
        except OSError as error:
            raise InputError(str(path), f"cannot be read ({error.strerror})", "restore the file") from None
        attachments.append(_attachment(path.name, media_type, data, log_ns))
    return attachments


def file_attachment(path: Path, log_ns: int) -> Attachment:
    """Any other file, for instance the model whose feedforward is played."""
    try:
        return _attachment(path.name, "application/octet-stream", path.read_bytes(), log_ns)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "name a file that is there") from None


def attached_installation(attachments: Iterable[Attachment], place: str) -> Installation | None:
    """The installation that a recording was made with; None when it carries none. InputError when it is damaged."""
    for attachment in attachments:
        if attachment.name == RESOLVED:
            try:
                return Installation.model_validate_json(attachment.data)
            except ValidationError as error:
                what = "; ".join(str(e["msg"]) for e in error.errors())
                raise InputError(
                    f"{place}, attachment {RESOLVED}", what, "read it with the version that wrote it"
                ) from None
    return None


def _resolved(installation: Installation) -> str:
    """JSON with file names instead of this machine's paths, so that equal installations give equal bytes."""
    data = installation.model_dump(mode="json")
    data["path"] = installation.path.name
    for drive in data["drives"].values():
        drive["eds"] = Path(drive["eds"]).name
    return json.dumps(data, ensure_ascii=False, sort_keys=True, indent=1)


def _attachment(name: str, media_type: str, data: bytes, log_ns: int) -> Attachment:
    return Attachment(create_time=0, log_time=log_ns, name=name, media_type=media_type, data=data)
