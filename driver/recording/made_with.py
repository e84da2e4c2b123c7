"""The arm that a recording was made with, as its beginning says; a file that was cut off has that too."""

from __future__ import annotations

import mmap
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Metadata

from driver.recording.mcap_records import is_mcap, parse, whole_records
from driver.recording.run_writer import METADATA


def arm_made_with(path: Path | str) -> str | None:
    """The arm's name; None where the file says none: it is another's, no MCAP file, or cut before that.

    Raises OSError when it cannot be read.
    """
    with Path(path).open("rb") as stream:
        if not is_mcap(stream.read(8)):
            return None
        with mmap.mmap(stream.fileno(), 0, prot=mmap.PROT_READ) as mapped, memoryview(mapped) as data:
            for opcode, start, end in whole_records(data, 8):
                if opcode == Opcode.CHUNK:  # what stands for the whole run stands before its messages
                    return None
                if opcode == Opcode.METADATA:
                    try:
                        found = parse(Metadata, data[start:end])
                    except ValueError:
                        return None
                    if found.name == METADATA:
                        return found.metadata.get("arm")
    return None
