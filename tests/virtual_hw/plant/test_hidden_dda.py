"""The direct drive arm's hidden bodies have the base parameters of Table 4.2, by the formulae of Table 4.3."""

from __future__ import annotations

import numpy as np
import pytest

from config import load_installation
from virtual_hw.hidden import load_hidden
from virtual_hw.plant import build_plant

L2 = 0.45

# Table 4.2: identifiable alone.
ALONE = {
    "mcx2": -0.1591,
    "Ixy2": 0.3894,
    "Ixz2": 0.0118,
    "mcx3": 0.4676,
    "mcy3": 0.0315,
    "Ixy3": -0.0256,
    "Ixz3": 0.0143,
    "Iyz3": -0.0160,
    "Izz3": 0.3568,
}
# Table 4.3, computed from Table 4.2 (its 15.7029 should read 15.4029).
COMBINED = {
    "m3cz3·l2 + Iyz2": -1.0589,
    "Ixx3 − Iyy3": -0.3691,
    "Izz2 + Ixx3": 0.7082,
    "Izz1 + Ixx2 + Ixx3 + m3·l2²": 15.4029,
    "Ixx2 + Ixx3 − Iyy2": 0.4709,
    "m3cz3 − m2cy2": -1.6863,
}


def matrix(values: tuple[float, ...]) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.fixture(scope="module", params=["dda", "dda-clean"])
def links(request):
    """Per link: mass, first moment, inertia about the link's frame (Steiner's theorem) and the excess."""
    hidden = load_hidden(load_installation("dda"), request.param)
    excess = {e.link: matrix(e.inertia_kg_m2) for e in hidden.inertia_excess}
    result = []
    for number in (1, 2, 3):
        link = next(b for b in hidden.link if b.link == f"link{number}")
        m, c = link.mass_kg, np.array(link.centre_m)
        body = matrix(link.inertia_kg_m2) + m * (c @ c * np.eye(3) - np.outer(c, c))
        result.append((m, m * c, body, body + excess.get(link.link, 0.0)))
    return result


def test_parameters_identifiable_alone_are_those_of_table_4_2(links):
    (_, mc2, _, i2), (_, mc3, _, i3) = links[1:]
    found = {
        "mcx2": mc2[0],
        "Ixy2": i2[0, 1],
        "Ixz2": i2[0, 2],
        "mcx3": mc3[0],
        "mcy3": mc3[1],
        "Ixy3": i3[0, 1],
        "Ixz3": i3[0, 2],
        "Iyz3": i3[1, 2],
        "Izz3": i3[2, 2],
    }
    assert found == pytest.approx(ALONE, abs=1e-8)


def test_combinations_are_those_of_table_4_3(links):
    (_, _, _, i1), (_, mc2, _, i2), (m3, mc3, _, i3) = links
    found = {
        "m3cz3·l2 + Iyz2": mc3[2] * L2 + i2[1, 2],
        "Ixx3 − Iyy3": i3[0, 0] - i3[1, 1],
        "Izz2 + Ixx3": i2[2, 2] + i3[0, 0],
        "Izz1 + Ixx2 + Ixx3 + m3·l2²": i1[2, 2] + i2[0, 0] + i3[0, 0] + m3 * L2**2,
        "Ixx2 + Ixx3 − Iyy2": i2[0, 0] + i3[0, 0] - i2[1, 1],
        "m3cz3 − m2cy2": mc3[2] - mc2[1],
    }
    assert found == pytest.approx(COMBINED, abs=2e-5)


def test_every_body_is_one_and_table_4_2_is_none(links):
    """∫yy dm etc. of a body form a positive matrix; the table's link 3 has ∫y² dm < 0, so an excess must be."""
    for mass, first, about_frame, _ in links:
        second = 0.5 * np.trace(about_frame) * np.eye(3) - about_frame
        pseudo = np.block([[second, first[:, None]], [first[None, :], np.array([[mass]])]])
        assert np.linalg.eigvalsh(pseudo)[0] > 0
    assert ALONE["Izz3"] + COMBINED["Ixx3 − Iyy3"] < 0


def test_the_plant_moves_by_these_parameters():
    """Joint 1 alone at q2 = q3 = 0: there its axis is y2 and −z3, and link 3 lies 0.45 m outward along y3."""
    installation = load_installation("dda")
    arm = installation.arm.model_copy(update={"home_rad": (0.0, 0.0, 0.0)})
    installation = installation.model_copy(update={"arm": arm})
    hidden = load_hidden(installation, "dda-clean")
    motors = tuple(m.model_copy(update={"bandwidth_hz": 1e7}) for m in hidden.motor)
    plant = build_plant(installation, hidden.model_copy(update={"motor": motors}), 1)
    # Joints 2 and 3 are braked, so joint 1 turns the arm as one body.
    for _ in range(20):
        plant.advance([100.0, 0.0, 0.0], [False, True, True])
    acceleration = plant.true_state()[1][0] / 20e-3
    izz1_iyy2_m3l2 = COMBINED["Izz1 + Ixx2 + Ixx3 + m3·l2²"] - COMBINED["Ixx2 + Ixx3 − Iyy2"]
    expected = izz1_iyy2_m3l2 + ALONE["Izz3"] + 2 * L2 * ALONE["mcy3"]
    assert 100.0 / acceleration == pytest.approx(expected, abs=1e-3)
