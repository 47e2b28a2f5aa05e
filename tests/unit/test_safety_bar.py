"""What errors of the loads mean for safety factor and verdict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenes import on_bed

from incipient.accuracy.errorbars import with_safety
from incipient.accuracy.goal import bar_of_safety
from incipient.contact import Contacts, Load
from incipient.evaluation.contact_verdict import find_contacts
from incipient.results.errorbars import ErrorBars, SafetyBar, Term
from incipient.results.loads import Forces, Torques

ZERO = np.zeros(3)
# A disc of weight one between two contacts at 45 degrees without friction is tipped over one of them by a horizontal
# force equal to its weight.


def pocket() -> Contacts:
    s = np.sqrt(0.5)
    normals = np.array([[-s, -s, 0.0], [s, -s, 0.0]])
    return Contacts(0.5 * normals, normals, None)


def bar(force: float, **errors: float) -> SafetyBar:
    load = Load(np.array([force, 0, 0]), np.zeros(3), np.array([0, -1.0, 0]), np.zeros(3))
    of_loads = {name: error * np.eye(6)[0] for name, error in errors.items()}
    return bar_of_safety(load, pocket(), 0.0, (1.0, 0.125 * np.eye(3)), of_loads)


def test_safety_factor_and_its_bar() -> None:
    found = bar(0.98, discretisation=0.01)
    assert found.value == pytest.approx(1.0 / 0.98)
    assert (found.low, found.high) == pytest.approx((1.0 / 0.99, 1.0 / 0.97))
    assert found.certain
    assert len(found.modes) == 1
    assert "certain within the error bars" in found.sentence()


def test_not_certain_and_what_decides() -> None:
    found = bar(0.98, discretisation=0.005, gap=0.03, domain=0.01)
    assert not found.certain
    assert found.low < 1.0 < found.high
    assert len(found.modes) == 2
    assert found.decisive == "gap"
    assert "reduce the error of the gap" in found.sentence()


def test_moving_for_certain() -> None:
    found = bar(1.05, gap=0.02)
    assert found.certain
    assert found.high < 1.0


def test_no_terms_no_bar() -> None:
    found = bar(0.5)
    assert (found.low, found.high, found.decisive) == (found.value, found.value, "")


def held_disc(torque: float, error: float, friction: float = 0.1, inert: bool = True) -> SafetyBar:
    """A disc of weight one between two contacts 30 degrees to either side of its lowest point, turned by a torque."""
    s, c = 0.5, np.sqrt(0.75)
    normals = np.array([[-s, -c, 0.0], [s, -c, 0.0]])
    load = Load(np.zeros(3), np.array([0, 0, torque]), np.array([0, -1.0, 0]), np.zeros(3))
    mass_and_inertia = (1.0, 0.125 * np.eye(3)) if inert else None
    errors = {"gap": error * np.eye(6)[5]}
    return bar_of_safety(load, Contacts(0.5 * normals, normals), friction, mass_and_inertia, errors)


def test_no_certainty_from_corners_that_move() -> None:
    """At every corner it moves, by one mode; without a torque, which is within the bars, it rests at any factor."""
    found = held_disc(0.1, 0.25)
    assert not found.certain
    assert set(found.modes) == {"pivoting and sliding", "rest"} and not found.complete
    assert found.low == pytest.approx(0.1633, abs=1e-4)
    assert found.high == np.inf
    assert found.relative == np.inf
    assert "NOT certain" in found.sentence()


@pytest.mark.parametrize(
    ("torque", "error", "friction", "outcome"),
    [
        (
            0.1,
            0.02,
            0.1,
            "it moves (pivoting and sliding, at this load and at the worst within the bars)",
        ),
        (0.02, 0.01, 0.1, "it rests"),
        (
            0.6,
            0.3,
            0.7,
            "it moves (pivoting and sliding, at this load and at the worst within the bars)",
        ),
    ],
)
def test_what_is_certain_is_said(
    torque: float, error: float, friction: float, outcome: str
) -> None:
    found = held_disc(torque, error, friction)
    assert found.certain and found.complete is (outcome == "it rests")
    assert f"certain within the error bars: {outcome}; safety factor" in found.sentence()


def test_a_mode_is_not_certain_without_proof() -> None:
    """Without mass and inertia it is not asked; modes are those of the load and of its worst corner."""
    alone = held_disc(0.1, 0.02, inert=False)
    assert alone.certain and not alone.complete
    assert "certain within the error bars: it moves; safety factor" in alone.sentence()
    points = np.array([[x, y, -0.1] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    contacts = Contacts(points, np.tile([0, 0, -1.0], (4, 1)))
    load = Load(np.array([0.6, 0, 0]), np.zeros(3), np.array([0, 0, -1.0]), np.zeros(3))
    block = bar_of_safety(load, contacts, 0.3, (1.0, np.eye(3)), {"gap": 0.1 * np.eye(6)[0]})
    assert block.certain and not block.complete
    assert "it moves (sliding, at this load and at the worst within the bars)" in block.sentence()


def test_held_by_the_flow_alone() -> None:
    """Its weight alone moves the block; the flow pushes back with 1 +- error, and 0.1 to 1.1 times that hold it."""
    contacts = Contacts(np.array([[-1.0, 0, 0], [1.0, 0, 0]]), np.tile([0, -1.0, 0], (2, 1)))
    load = Load(np.array([-1.0, 0, 0]), np.zeros(3), np.array([0.6, -1.0, 0]), np.zeros(3))
    errors = {"gap": 0.2 * np.eye(6)[0], "domain": 0.05 * np.eye(6)[0]}
    found = bar_of_safety(load, contacts, 0.5, (1.0, np.eye(3)), errors)
    assert (found.value, found.low, found.high, found.certain) == (0.0, 0.0, 0.0, False)
    assert found.decisive == "gap"
    assert found.relative > 0.0
    assert "0.08 to 1.467 times the flow's load may hold it" in found.sentence()
    del errors["gap"]
    assert bar_of_safety(load, contacts, 0.5, (1.0, np.eye(3)), errors).modes == ("rest",)


def term(doubt: str = "") -> Term:
    return Term("discretisation", np.array([1e-4, 0.0, 0.0]), ZERO, "how", doubt=doubt)


@pytest.mark.parametrize("doubt", ["", "for a reason"])
def test_nothing_is_certain_in_doubt(doubt: str) -> None:
    scene = on_bed("contact.friction=5", "body.density=9")
    run: Any = SimpleNamespace(scene=scene, contacts=find_contacts(scene), wall_report=lambda: None)
    force = Forces(
        np.array([0.01, 0.0, 0.0]), ZERO, np.array([0.0, 1.0, 0.0]), np.array([0.0, -9.0, 0.0])
    )
    bars = with_safety(
        ErrorBars((term(doubt),)), run, force, Torques(np.array([0.0, 0, 1e-4]), ZERO, ZERO)
    )
    assert bars.safety is not None
    sure = with_safety(
        ErrorBars((term(),)), run, force, Torques(np.array([0.0, 0, 1e-4]), ZERO, ZERO)
    ).safety
    assert sure is not None and sure.certain
    assert bars.safety.certain == (not doubt)
    assert bars.safety.decisive == "discretisation"
    assert any("more than twice as large: for a reason" in line for line in bars.lines()) == bool(
        doubt
    )
