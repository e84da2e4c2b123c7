"""Runs the stand-in arm in a process of its own, for tests: ``python standin_process.py ARM DIRECTORY MODE SEED``."""

from __future__ import annotations

import sys
from pathlib import Path

from config import InputError, load_installation
from virtual_hw.standin import run_standin


def main(arm: str, directory: str, mode: str, seed: str) -> int:
    try:
        run_standin(
            load_installation(arm),
            None,
            mode == "lockstep",
            int(seed),
            lambda: print("ready", flush=True),
            Path(directory),
        )
    except InputError as error:
        print(error, flush=True)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
