"""The command `return`."""

from __future__ import annotations

from dataclasses import asdict

from config.paths import run_directory
from service.cli.console import progress, publish, say
from service.cli.options import ArmOption, JsonOption, installation_of


def return_inside(arm: ArmOption = None, json: JsonOption = None) -> None:
    """Move joints that stand outside their limits slowly back inside. The daemon must not be running."""
    from service.daemon.lock import ArmLock
    from service.return_inside import bring_inside, in_lockstep, outside, where_it_stands

    installation = installation_of(arm)
    lock = ArmLock(run_directory(), installation.arm.name)
    try:
        lockstep = in_lockstep(installation)
        stands = where_it_stands(installation, lockstep=lockstep)
        found, q = outside(installation, stands), tuple(stands.tolist())
        for one in found:
            say(f"{one}; it is moved slowly to {one.to:.4g}")
        if found:
            with progress() as tell:
                q = bring_inside(installation, stands, lockstep=lockstep, progress=tell).q
    finally:
        lock.release()
    answer = {"arm": installation.arm.name, "brought_inside": [asdict(one) for one in found], "q": q}
    publish(answer, json, f"{len(found) or 'no'} joints were outside their limits; all are inside")
