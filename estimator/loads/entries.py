"""A load as the entries of a JSON answer, and in words what of it cannot be told."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.loads.parameters import Measured, RigidLoad
from estimator.rigid_body import PARAMETERS

Array = NDArray[np.float64]


def load_entries(load: RigidLoad, held: bool) -> dict[str, Any]:
    """Mass, centre, inertia, principal moments and axes, each with value, standard error and unit; what is not told
    is null. ``held``: standard errors are withheld."""
    axes = load.principal_axes
    return {
        "mass": entry(load.mass, "kg", held),
        "centre": entry(load.centre, "m", held),
        "inertia": entry(load.inertia, "kg·m²", held),
        "principal_moments": entry(load.principal_moments, "kg·m²", held),
        "principal_axes": {
            "value": plain(np.where(axes.told[:, None], axes.value, np.nan)),
            "standard_error": plain(np.full(3, np.nan) if held else axes.standard_error),
            "unit": "rad",
        },
    }


def load_warnings(load: RigidLoad) -> list[str]:
    """What of a load cannot be told, and what would tell it."""
    result = []
    unknown = [name for name, x in zip(PARAMETERS, load.parameters, strict=True) if not np.isfinite(x)]
    if unknown:
        result.append(f"the motion does not tell {', '.join(unknown)}: turn the load faster, about all three axes")
        return result
    moments = load.principal_moments
    if not np.all(moments.value > 2.0 * moments.standard_error):
        result.append("principal moments are within their errors of zero: turn the load faster, about all three axes")
    elif moments.value[0] > moments.value[1] + moments.value[2] + 2.0 * np.sum(moments.standard_error):
        result.append("the principal moments are those of no real body: check the sensor's frame and calibration")
    told = load.principal_axes.told
    if not told.all():
        which = ", ".join(str(k + 1) for k in np.flatnonzero(~told))
        result.append(f"principal axes {which} cannot be told: their moments are equal within their errors")
    if load.parameters[0] < 2.0 * load.mass.standard_error:
        result.append("the mass is within its error of zero: is there a load, and is the wrench's sign right?")
    return result


def plain(x: Array) -> Any:
    """Numbers and lists for JSON; what is not finite is null."""
    if np.ndim(x) == 0:
        return float(x) if np.isfinite(x) else None
    return [plain(row) for row in x]


def entry(measured: Measured, unit: str, held: bool) -> dict[str, Any]:
    """One quantity as value, standard error and unit; ``held``: its error is withheld (null)."""
    error = np.full(np.shape(measured.value), np.nan) if held else measured.standard_error
    return {"value": plain(measured.value), "standard_error": plain(error), "unit": unit}
