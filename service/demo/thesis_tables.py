"""Tables 4.1 to 4.3 of the thesis, and identified base parameters beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from estimator.identification import LinkIdentification
from service.reports.link_tables import figure

Array = NDArray[np.float64]

TABLE_4_1 = (
    (67.13, 0.0, 2.432, 35.8257, 23.1568, 0.0, -0.3145, 20.4472, -1.2948, 0.7418),
    (53.01, 0.0, 3.4081, 16.6505, 7.9088, 0.0, 0.0, 7.6766, -1.5036, 0.6807),
    (19.67, 0.3108, 0.0, 0.3268, 0.1825, 0.0, -0.0166, 0.4560, 0.0, 0.3900),
)
"""CAD-modelled: m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of each link. (The row of Ixx is printed as "Izz".)"""

TABLE_4_2 = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.33598),
    (0.0, -0.1591, 0.6776, 0.0, 4.1562, 0.3894, 0.0118, 5.2129, -0.6050, -0.8194),
    (1.8920, 0.4676, 0.0315, -1.0087, 1.5276, -0.0256, 0.0143, 1.8967, -0.0160, 0.3568),
)
"""Estimated. Table 4.3 holds sums of these; its 15.7029 is a misprint of the sum 15.4029."""


def beside_the_tables(result: LinkIdentification) -> list[dict[str, Any]]:
    """Each base parameter: identified, its standard error, and what the thesis estimated and had from CAD."""
    combination = result.base.combination
    thesis = combination @ np.ravel(TABLE_4_2)
    cad = combination @ np.ravel(TABLE_4_1)
    errors = result.standard_error[: result.base.rank]
    return [
        {
            "name": name,
            "unit": unit,
            "table": "4.2" if name in result.base.alone else "4.3",
            "identified": float(value),
            "standard_error": float(error),
            "thesis": float(estimated),
            "cad": float(modelled),
        }
        for name, unit, value, error, estimated, modelled in zip(
            result.base.names, result.base.units, result.beta, errors, thesis, cad, strict=True
        )
    ]


def comparison_table(rows: list[dict[str, Any]]) -> Table:
    """The comparison for a person, the thesis' order: single parameters (Table 4.2), then combinations (4.3)."""
    table = Table(title="Links of the direct drive arm, identified over the bus", title_justify="left", box=None)
    for heading, justify in (
        ("base parameter", "left"),
        ("unit", "left"),
        ("identified", "right"),
        ("± std. error", "right"),
        ("thesis, estimated", "right"),
        ("difference", "right"),
        ("thesis, CAD (4.1)", "right"),
        ("thesis' table", "left"),
    ):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for row in sorted(rows, key=lambda r: r["table"]):
        table.add_row(
            row["name"],
            row["unit"],
            f"{row['identified']:.4f}",
            figure(row["standard_error"]),
            f"{row['thesis']:.4f}",
            f"{row['identified'] - row['thesis']:+.4f}",
            f"{row['cad']:.4f}",
            row["table"],
        )
    return table
