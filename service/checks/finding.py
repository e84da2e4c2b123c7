"""One line of `etude check`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "warn", "fail"]


@dataclass(frozen=True)
class Finding:
    """What was looked at, how it is, and what to do about it when it is not well.

    "warn": works, less well than it should; "fail": this installation cannot run as it is.
    """

    area: str
    subject: str
    verdict: Verdict
    detail: str
    remedy: str = ""
