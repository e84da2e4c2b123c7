"""The contract of an effect, which every effect of the catalogue keeps by being there."""

from __future__ import annotations

import re
from copy import deepcopy

import numpy as np
import pytest
from numpy.typing import NDArray

from config.loader import HERE
from estimator.effects import Effect, Place, Scales, Signals, catalogue, effect
from estimator.rigid_body import PARAMETERS, RigidBody
from estimator.twin.plant import Instant, PlantDraft

Array = NDArray[np.float64]

PARAMETERS_OF = {
    "viscous_friction": {"coefficient", "bend", "sharpness"},
    "coulomb_friction": {"level"},
    "asymmetric_friction": {"level_positive", "level_negative", "coefficient_positive", "coefficient_negative"},
    "stribeck_friction": {"level", "breakaway", "velocity", "coefficient", "exponent"},
    "load_dependent_friction": {"coefficient"},
    "presliding": {"stiffness", "level"},
    "friction_drift": {
        *("initial", "final", "initial_coefficient", "final_coefficient"),
        *("time_constant", "initial_temperature", "final_temperature"),
    },
    "rotor_inertia": {"inertia"},
    "joint_spring": {"stiffness", "centre", "bend", "straight"},
    "joint_elasticity": {"stiffness", "damping"},
    "backlash": {"gap"},
    "cogging": {"order", "amplitude", "phase"},
    "torque_ripple": {"order", "amplitude", "phase"},
    "torque_constant_error": {"gain"},
    "torque_nonlinearity": {"limit", "dead_zone"},
    "torque_offset": {"offset"},
    "transmission_coupling": {"joint_other", "ratio", "coefficient", "level", "inertia"},
    "link_inertia": set(PARAMETERS),
    "payload": {"mass", "centre", "inertia"},
    "base_tilt": {"roll", "pitch"},
    "contact": {"where", "force"},
    "transport_delay": {"delay"},
    "encoder_offset": {"offset"},
    "encoder_eccentricity": {"amplitude", "phase"},
    "velocity_sensor_gain": {"gain"},
    "wrench_bias": {"bias"},
    "wrench_drift": {"rate"},
    "wrench_gain": {"matrix"},
    "wrench_misalignment": {"rotation"},
    "wrench_resonance": {"frequency", "damping"},
    "nonrigid_load": set[str](),
}
SYMBOL = r"(N|m|kg|rad|s|Hz|turn|K|°C)[²³]?"
PRODUCT = rf"(1|{SYMBOL}(·{SYMBOL})*)(/{SYMBOL})*"
UNIT = re.compile(rf"–|{PRODUCT}(, {PRODUCT})?")

everyone = pytest.mark.parametrize("name", sorted(catalogue()))
LAWS = [(name, law) for name, found in sorted(catalogue().items()) for law in found.laws()]
every_law = pytest.mark.parametrize("found", [law for _, law in LAWS], ids=[type(law).__name__ for _, law in LAWS])


def a_place(found: Effect, body: RigidBody) -> Place:
    """One in the middle of the arm, where joints are that carry others."""
    places = found.places(body)
    return places[len(places) // 3]


def possible(found: Effect, place: Place, scales: Scales, theta: Array, count: int, seed: int = 0) -> Array:
    """Coefficients within their limits."""
    values = np.random.default_rng(seed).uniform(0.1, 0.5, count)
    limits = found.limits(place, scales, theta)
    return values if limits is None else np.clip(values, *limits)


def test_the_catalogue_is_the_documented_one() -> None:
    told: dict[str, set[str]] = {}
    for name, law in LAWS:
        told.setdefault(name, set()).update(law.units)
    assert told == PARAMETERS_OF
    with pytest.raises(Exception, match="not in the catalogue"):
        effect("gremlins")


@everyone
def test_it_says_what_it_is(name: str, arm: RigidBody) -> None:
    found = effect(name)
    assert type(found).__module__.endswith(f".{name}")
    assert all(UNIT.fullmatch(unit) for unit in found.units.values())
    assert "{" not in found.experiment_at(found.places(arm)[0], arm)
    assert found.experiment[0].islower(), "it stands in the middle of a sentence"
    others = {other.split(" of a neighbour")[0] for other in found.confused_with}
    assert others, "nothing in the catalogue is beyond confusion"
    assert others | set(found.contains) <= set(catalogue())


@everyone
def test_it_is_documented_with_its_parameters(name: str) -> None:
    rows = [line for line in (HERE.parent / "docs" / "effects.md").read_text().splitlines() if f"`{name}`" in line]
    assert rows, "docs/effects.md has no row for it"
    named = set(re.findall(r"`(\w+)`", "".join(rows)))
    assert PARAMETERS_OF[name] - set(PARAMETERS[1:-1]) <= named


@everyone
def test_places_and_rows_are_of_the_arm(name: str, arm: RigidBody) -> None:
    found = effect(name)
    places = found.places(arm)
    assert len(set(places)) == len(places) > 0
    for place in places:
        rows = found.rows(arm, place)
        assert list(rows) == sorted(set(rows))
        assert set(rows) <= set(range(6 if found.equation_at(place) == "wrench" else arm.n))


def shapes(found: Effect, place: Place, scales: Scales) -> Array:
    """(k, p) all theta that are tried; of what has hundreds of finer ones, some."""
    finer = found.finer(place, scales)
    return np.vstack([found.grid(place, scales), *([finer[:: max(1, len(finer) // 8)]] if len(finer) else [])])


@every_law
def test_columns_are_finite_for_every_choice(found: Effect, signals: Signals, scales: Scales) -> None:
    felt = 0
    for place in found.places(signals.body):
        rows, free = len(found.rows(signals.body, place)), set()
        grid = shapes(found, place, scales)
        assert grid.ndim == 2
        assert 0 < len(grid) <= 96
        for theta in grid[[0, len(grid) // 2, -1]]:
            columns = found.columns(place, signals, theta)
            count = columns.shape[2]
            assert columns.shape == (signals.samples, rows, count)
            assert np.isfinite(columns).all()
            # Slopes are taken beside it, where a choice is still the same.
            for beside in (0.999 * theta, theta + 1e-3 * (theta == 0.0)):
                assert found.columns(place, signals, beside).shape == columns.shape
            if speeds := found.speed_rows(signals.body, place):
                assert found.equation_at(place) == "torque"
                assert found.speed_columns(place, signals, theta).shape == (signals.samples, len(speeds), count)
            felt += bool(np.any(columns))
            limits = found.limits(place, scales, theta)
            if limits is None:
                free.add(count)
                continue
            low, high = limits
            assert low.shape == high.shape == (count,)
            assert np.all(low < high)
            # A gap's shape is made of its width: a far smaller one has another.
            least = theta[0] if found.name == "backlash" else 0.0
            assert np.all((low <= least) & (high > 0.0)), "an arm without the effect must be possible"
        assert len(free) <= 1, "without limits all have as many coefficients"
    assert felt


@every_law
def test_parameters_are_those_of_the_catalogue_and_come_back(found: Effect, signals: Signals, scales: Scales) -> None:
    place, told = a_place(found, signals.body), set[str]()
    for number, theta in enumerate(shapes(found, place, scales)):
        count = found.columns(place, signals, theta).shape[2]
        parameters = found.parameters(place, theta, possible(found, place, scales, theta, count, number))
        assert set(parameters) <= set(found.units)
        told |= set(parameters)
        again = found.parameters(place, *found.unknowns(place, parameters))
        for key, value in parameters.items():
            np.testing.assert_allclose(again[key], value, rtol=1e-9, atol=1e-12)
    assert told == set(found.units)


@every_law
def test_what_is_not_linear_in_its_size_is_small_in_the_grid_and_its_own_size_fitted(
    found: Effect, signals: Signals, scales: Scales
) -> None:
    place = a_place(found, signals.body)
    about, theta = list(found.about), found.grid(place, scales)[0]
    coefficients = possible(found, place, scales, theta, found.columns(place, signals, theta).shape[2])
    assert not found.grid(place, scales)[:, about].any()
    exact = found.exact_at(theta, coefficients)
    np.testing.assert_array_equal(exact[about], coefficients[: len(about)])
    own, back = found.unknowns(place, found.parameters(place, exact, coefficients))
    np.testing.assert_allclose(own[about], back[: len(about)])


@every_law
def test_torque_is_what_the_columns_say(found: Effect, signals: Signals, scales: Scales) -> None:
    place = a_place(found, signals.body)
    theta = found.grid(place, scales)[0]
    count = found.columns(place, signals, theta).shape[2]
    parameters = found.parameters(place, theta, possible(found, place, scales, theta, count))
    torque = found.torque(place, parameters, signals)
    assert torque.shape == signals.q.shape
    if found.equation_at(place) != "torque":
        assert not torque.any()
        return
    theta, coefficients = found.unknowns(place, parameters)
    rows = list(found.rows(signals.body, place))
    np.testing.assert_allclose(torque[:, rows], found.columns(place, signals, theta) @ coefficients)
    elsewhere = [joint for joint in range(signals.body.n) if joint not in rows]
    assert not torque[:, elsewhere].any()
    nothing = found.parameters(place, theta, np.zeros(count))
    np.testing.assert_allclose(found.torque(place, nothing, signals), 0.0, atol=1e-12)


@every_law
def test_it_says_how_it_moves_the_simulated_arm(found: Effect, signals: Signals, scales: Scales) -> None:
    place = a_place(found, signals.body)
    theta = found.grid(place, scales)[0]
    count = found.columns(place, signals, theta).shape[2]
    parameters = found.parameters(place, theta, possible(found, place, scales, theta, count))
    before = PlantDraft(signals.body, signals.body.prior())
    plant = deepcopy(before)
    found.simulate(place, parameters, plant)
    if not type(found).__module__.split(".")[-1].startswith(("wrench_", "nonrigid_")):
        assert differs(before, plant)
    else:
        assert not differs(before, plant)


@every_law
def test_it_is_the_one_of_its_name_that_has_its_parameters(found: Effect) -> None:
    assert effect(found.name).of(found.units) is found


def differs(one: PlantDraft, other: PlantDraft) -> bool:
    pairs = [(getattr(one, key), getattr(other, key)) for key in vars(one) if key != "body"]
    return any(not np.array_equal(a, b) if isinstance(a, np.ndarray) else a != b for a, b in pairs)


def test_the_example_of_the_guide_is_an_effect(signals: Signals) -> None:
    text = (HERE.parent / "docs" / "adding.md").read_text()
    _, code, _ = re.split(r"```python\n|```\n", text[text.index("## An effect") :], maxsplit=2)
    names: dict[str, object] = {"__name__": "example"}
    exec(compile(code, "docs/adding.md", "exec"), names)
    drag = names["EFFECT"]
    assert isinstance(drag, Effect)
    found = drag.torque(Place(1), {"coefficient": 0.5}, signals)[:, 1]
    np.testing.assert_allclose(found, 0.5 * np.abs(signals.dq[:, 1]) * signals.dq[:, 1])
    plant = PlantDraft(signals.body, signals.body.prior())
    drag.simulate(Place(1), {"coefficient": 0.5}, plant)
    ((joint, law),) = plant.rubbing
    at = Instant()
    at.dq = -2.0
    assert (joint, law(at)) == (1, pytest.approx(2.0))
