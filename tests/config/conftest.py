"""A copy of a shipped arm that a test may spoil."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from config import Installation, load_installation
from config.loader import HERE

Spoil = Callable[[str, str, str, str], Path]


@pytest.fixture(scope="session")
def dda() -> Installation:
    return load_installation("dda")


@pytest.fixture
def spoilt(tmp_path: Path) -> Spoil:
    """``spoilt("dda", file, old, new)``: the installation file of a copy in which ``old`` of ``file`` became ``new``.

    The drives lie beside it, so that they can be spoilt too.
    """

    def make(arm: str, file: str, old: str, new: str) -> Path:
        for source in [*(HERE / "arms" / arm).iterdir(), *(HERE / "drives").iterdir()]:
            if source.is_file():
                shutil.copy(source, tmp_path / source.name)
        changed = tmp_path / file
        text = changed.read_text()
        assert old in text, f"{file} no longer holds {old!r}"
        changed.write_text(text.replace(old, new, 1))
        return tmp_path / "installation.toml"

    return make
