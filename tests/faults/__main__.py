"""``make faults``: runs the fault matrix, prints what was seen of each fault, and a digest that is the same each time.

With ``--socketcan`` on SocketCAN, one fault after another: in the guest (tests/vcan/guest), whose time is virtual.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from rich.console import Console
from rich.table import Table

from tests.faults.matrix import Seen, run_on_dda, silence
from tests.faults.on_socketcan import ALL, IN_VIRTUAL_TIME, run_on_socketcan
from tests.faults.scenarios import SCENARIOS

HEADINGS = ("family", "fault", "the arm", "seen by", "cycles", "bound", "moved on", "kept", "what it says")
WIDTH = 200


def main() -> int:
    """Returns 1 when a fault was not seen as it must be."""
    on_socketcan = sys.argv[1:] == ["--socketcan"]
    where = "SocketCAN" if on_socketcan else "the local bus"
    table = Table(title=f"Fault matrix on the MIT direct drive arm, on {where}; cycles of 1 ms, frames kept")
    for heading in HEADINGS:
        table.add_column(heading, justify="right" if heading in ("cycles", "bound", "kept") else "left")
    count = failures = 0
    bytes_of_all = hashlib.sha256()
    for seen in _on_socketcan() if on_socketcan else _on_local_bus():
        table.add_row(*_row(seen), style="red" if seen.problems else None)
        bytes_of_all.update(seen.digest.encode())
        count += 1
        failures += bool(seen.problems)
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)
    print(f"{count} faults, {failures} not as they must be")
    print(f"digest of every byte on the wires and every sentence: {bytes_of_all.hexdigest()[:16]}")
    return 1 if failures else 0


def _on_local_bus() -> Iterator[Seen]:
    workers = min(2, os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=silence) as pool:
        yield from pool.map(run_on_dda, SCENARIOS)


def _on_socketcan() -> Iterator[Seen]:
    if not IN_VIRTUAL_TIME:
        sys.exit("bounds in cycles hold in virtual time: tests/vcan/guest --interfaces 'vcan0 vcan1 vcan2' -- COMMAND")
    return map(run_on_socketcan, ALL)


def _row(seen: Seen) -> tuple[str, ...]:
    scenario, stopped = seen.scenario, seen.outcome == "stops"
    says = seen.sentence.partition(";")[0] if seen.outcome != "goes on" else scenario.words
    return (
        scenario.family,
        scenario.name,
        seen.outcome,
        seen.by if seen.outcome != "goes on" else "",
        str(seen.cycles) if stopped else "",
        str(scenario.within) if stopped else "",
        f"{seen.travel_rad:.2f} rad",
        str(seen.kept_frames) if stopped else "",
        "; ".join(seen.problems) or says,
    )


if __name__ == "__main__":
    sys.exit(main())
