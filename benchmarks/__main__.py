"""`make bench`: measures every figure that README and docs quote, prints it beside its reference, and writes
``benchmarks/results.json``. Arguments choose modules by name: ``python -m benchmarks lockstep recorder``."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure

HERE = Path(__file__).parent
MODULES = sorted(p.stem.removeprefix("bench_") for p in HERE.glob("bench_*.py"))


def main() -> int:
    chosen = sys.argv[1:] or MODULES
    unknown = [name for name in chosen if name not in MODULES]
    if unknown:
        print(f"benchmarks: there is no {unknown[0]!r}; choose from {', '.join(MODULES)}", file=sys.stderr)
        return 2
    progress = Console(stderr=True)
    figures: list[Figure] = []
    for name in chosen:
        progress.print(f"[dim]{name} …")
        figures += importlib.import_module(f"benchmarks.bench_{name}").measure()

    table = Table("figure", "value", "unit", "reference", "its value", "ratio")
    for f in figures:
        reference = "–" if f.reference_value is None else f"{f.reference_value:.4g}"
        table.add_row(f.name, f"{f.value:.4g}", f.unit, f.reference, reference, f"{f.ratio:.3g}" if f.ratio else "–")
    Console(width=140).print(table)

    results = HERE / "results.json"
    kept = (
        {}
        if len(chosen) == len(MODULES) or not results.exists()
        else {f["name"]: f for f in json.loads(results.read_text())}
    )
    kept.update({f.name: f.as_dict() for f in figures})
    results.write_text(json.dumps(list(kept.values()), indent=1, ensure_ascii=False) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
