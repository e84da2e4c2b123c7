"""``python -m benchmarks.measured DIR``: every measured recording as CSV and URDF, for the commands as they are.

Then, for instance, ``etude identify links DIR/emps.csv --arm DIR/emps.urdf --hold-out DIR/emps_pulses.csv``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.measured import ADAPTORS, is_here, write_files


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: python -m benchmarks.measured DIR", file=sys.stderr)
        return 2
    for folder, adaptor in ADAPTORS.items():
        if not is_here(folder):
            print(f"{folder} is not in ../shared/data: left out", file=sys.stderr)
            continue
        for path in write_files(adaptor(), Path(sys.argv[1])):
            print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
