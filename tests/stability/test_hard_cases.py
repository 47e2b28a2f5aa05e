"""Hard cases: what is computed stays bounded and keeps its order, what cannot be is refused by name.

The energy on violently moving meshes is in
`test_moving_mesh.py`, the order in time for all masses in `tests/convergence/test_coupling.py`, made-up failures in
`tests/end_to_end/test_resume.py`.
"""

from __future__ import annotations

import numpy as np
import pytest
from hard import (
    MOTIONS,
    corrections,
    exact_wall_force,
    fastest,
    in_cavity,
    poiseuille_error,
    ride,
    steady_cavity,
    wall_force,
)
from random_contacts import FRICTIONS, PLACES, judged
from scenes import BOTELLA_PEYRET

from incipient.fluid import FlowModel

# P4-P3 on a graded grid of 43 columns (`demos/scenes/cavity.toml` at Re = 10,000), 0.2% from one 1.4 times coarser.
FINEST_CAVITY = np.array([-0.45920, 0.46495, -0.58224])


# -- bodies -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mass", "moment", "gap", "steps", "fastest"),
    [
        *((mass, moment, None, 4, min(0.2, 3.0 / (1 + mass)))
          for mass, moment in ((0, 0), (1e-6, 1e-6), (1e3, 1e3), (1e6, 1e6), (1, 0), (0, 1))),
        *((0, 0, gap, 2, 0.05) for gap in (1e-1, 1e-3)),  # beside a wall
    ],
)  # fmt: skip
def test_bodies_of_any_mass_and_inertia(
    mass: float, moment: float, gap: float | None, steps: int, fastest: float
) -> None:
    """No faster than the lid, and slower the heavier they are: the same impulse on m + 1 times the fluid's mass."""
    with in_cavity(mass, moment, gap=gap) as result:
        told = ride(result, 0.05, steps)
    assert told.completed
    assert told.corrections <= 4
    assert told.speed < fastest


@pytest.mark.parametrize("ratio", [0.0, 1e-3, 1.0, 1e3])
def test_exact_coupling_where_the_naive_iteration_fails(ratio: float) -> None:
    """Without the added mass the iteration diverges for bodies lighter than what they move (Causin et al. 2005)."""
    assert (corrections("step", 1e-2, ratio, exact=True) or 99) <= 4
    naive = corrections("step", 1e-2, ratio, exact=False)
    assert (naive is None) is (ratio <= 1.0)


@pytest.mark.parametrize(
    "courant", [0.01, 1.0, 100.0, pytest.param(1000.0, marks=pytest.mark.slow)]
)
def test_massless_body_in_tiny_and_huge_steps(courant: float) -> None:
    """Speeds stay below the lid's; a ride too long for one mesh ends by name, after steps that hold."""
    with in_cavity(0.0) as result:
        told = ride(result, 0.08 * courant, 2)
    assert told.speed < 0.2
    assert len(told.readings) > 1
    assert told.completed or "fold over" in told.ended


@pytest.mark.parametrize("stiffness", [1.0, 1e3, 1e9])
def test_stiff_couples(stiffness: float, couple_when_held: float) -> None:
    """A disc without inertia: the spring's angle is the flow's couple over the stiffness, whatever that is."""
    spring = lambda state: np.array([0.0, 0.0, -stiffness * state.orientation[0]])  # noqa: E731
    with in_cavity(0.0, load=spring, free=(False, False, True)) as result:
        told = ride(result, 0.05, 4)
    assert told.completed
    assert told.corrections <= 4
    if stiffness >= 1e3:
        assert stiffness * told.readings[-1, 5] == pytest.approx(couple_when_held, rel=2e-3)


@pytest.fixture(scope="module")
def couple_when_held() -> float:
    """The flow's couple on the disc after four steps if nothing is free."""
    with in_cavity(0.0, free=(False, False, False)) as result:
        ride(result, 0.05, 4)
        return float(result.part.end.flow_load[2])


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_lubrication(motion: str, gap: float) -> None:
    """Source: Jeffrey & Onishi (1981), see `exact_wall_force`; the box's walls, 10 diameters off, add up to 1.5%."""
    assert wall_force(motion, gap) == pytest.approx(exact_wall_force(motion, gap), rel=0.015)


# -- flows --------------------------------------------------------------------------------------


def test_stabilised_cavity_on_coarse_cells() -> None:
    """Re = 10,000 on 32 cells a side: plain elements have no solution there (none beyond Re = 8,300)."""
    assert steady_cavity(1e4, 32, True) == pytest.approx(FINEST_CAVITY, rel=0.03)


@pytest.mark.parametrize(
    ("n", "better"), [(8, True), pytest.param(16, True, marks=pytest.mark.slow), (32, False)]
)
def test_stabilisation_helps_where_cells_are_coarse(n: int, better: bool) -> None:
    """Re = 1000: above 30 the Reynolds number of cells calls for it, below 20 it is better left out."""
    published = list(BOTELLA_PEYRET.values())
    result = np.array([steady_cavity(1e3, n, stabilisation) for stabilisation in (False, True)])
    plain, stabilised = np.abs(result / published - 1).max(axis=1)
    assert bool(stabilised < plain) is better
    assert stabilised < 0.15


@pytest.mark.parametrize(
    ("reynolds", "cells", "step", "count", "convection", "most"),
    [
        *((1e4, 12, courant / 12, 6, convection, 1.5)
          for convection in ("implicit", "extrapolated") for courant in (0.01, 1.0)),
        *((400.0, 8, step, 5, "extrapolated", 3.0) for step in (1e-6, 1e3)),
    ],
)  # fmt: skip
def test_lid_set_off_at_once(
    reynolds: float, cells: int, step: float, count: int, convection: str, most: float
) -> None:
    """No speed much above the lid's, where the Reynolds number is high stabilised: plain elements reach 3 and 25."""
    high = reynolds > 1e3
    model = FlowModel(unsteady=True, convection=convection, stabilisation=high)
    assert fastest(reynolds, cells, step, count, model) < most


# -- the rest -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "height"), [(100.0, 1.0), (1e4, 1.0), (0.01, 1.0)])
def test_extreme_domains(length: float, height: float) -> None:
    """Poiseuille flow is in the elements' space."""
    columns, rows = (20, 4) if length > height else (4, 20)
    assert poiseuille_error(length, height, columns, rows) < 1e-9


@pytest.mark.parametrize("name", PLACES)
def test_degenerate_contacts(name: str) -> None:
    """Without friction any couple turns a disc; more friction never lets it move sooner."""
    told = [judged(name, friction) for friction in FRICTIONS]
    moves = [result.startswith("moves") for result, _ in told]
    assert moves[0]
    assert moves == sorted(moves, reverse=True)
    assert not any("nan" in result for result, _ in told)


def test_one_place_named_twice_is_one_contact() -> None:
    for friction in FRICTIONS:
        assert judged("the same contact three times", friction) == judged("one contact", friction)
