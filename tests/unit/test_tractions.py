"""Forces, torques and tractions against exact ones; the sign is that of sigma n with n out of the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import ball_in_box, integral, ring, square_in_box, unit_box

from incipient import forms
from incipient.coupled.tractions import TractionProbe
from incipient.fluid import FlowModel, Fluid, Open, Prescribed, no_slip, solve_steady
from incipient.fluid.derived import dissipation
from incipient.fluid.space import geometry_function, geometry_rows
from incipient.mesh.domain import Domain

SIZE = 0.3


def stream(
    profile: Callable[[np.ndarray], np.ndarray],
) -> Callable[[np.ndarray, float], np.ndarray]:
    """A flow along the first axis that depends on the second."""
    return lambda x, t: np.vstack([profile(x[1]), np.zeros((2, x.shape[1]))])


def past_square(domain: Domain, model: FlowModel, reynolds: float = 10.0) -> Fluid:
    """Shear flow past a square in an open channel."""
    moving = [Prescribed(name, stream(lambda y: y)) for name in ("top", "left", "bottom")]
    return Fluid(domain, model, [Open("right"), *moving, no_slip("body")], reynolds)


# -- the sign -----------------------------------------------------------------------------------


@pytest.mark.parametrize("g", [9.81, 0.0])
def test_buoyancy_sign(g: float) -> None:
    """Still water under gravity g carries a square of side s with the force (0, +g s^2): Archimedes.

    The paper prints the traction with n into the body (equations (9), (21)): that is the weight of the water. Without
    the body force still water bears nothing: the program adds buoyancy itself.
    """
    domain = square_in_box(SIZE, 0.4)
    force = (lambda place, time: ufl.as_vector([0.0, -g])) if g else None
    walls = [no_slip(name) for name in domain.names]
    with Fluid(domain, FlowModel(body_force=force), walls, reynolds=100.0) as fluid:
        fluid.solve(1e-12)
        probe = TractionProbe(fluid, "body", (0.8, 0.55))
        for resultant in (probe.resultant(), probe.surface_resultant()):
            assert resultant.force == pytest.approx([0.0, g * SIZE**2, 0.0], abs=1e-10)
            assert resultant.torque == pytest.approx(np.zeros(3), abs=1e-10)
        assert printed_force(fluid) == pytest.approx([0.0, -g * SIZE**2], abs=1e-10)


def printed_force(fluid: Fluid) -> list[float]:
    """The integral of sigma n with n out of the fluid, into the body."""
    v, p = ufl.split(fluid.state)
    n = ufl.FacetNormal(fluid.domain.mesh)
    traction = forms.surface_traction(v, p, n, fluid.viscosity, fluid.reference_map)
    return [
        integral(fluid.domain, component * fluid.domain.measure("body")) for component in traction
    ]


# -- exact flows --------------------------------------------------------------------------------


def test_the_viscosity_is_an_expression() -> None:
    """Between a wall and a lid at speed one, with nu = (1 + y)/Re: u = log(1 + y)/log 2, the shear stress 1/(Re log 2).

    The stress is the same at every height; its power on the lid is the heat that the flow makes.
    """
    domain = unit_box(2, 8)
    height = ufl.SpatialCoordinate(domain.mesh)[1]
    model = FlowModel(order=3, viscosity=lambda of_molecules: of_molecules * (1 + height))
    speed = stream(lambda y: np.log1p(y) / np.log(2.0))
    moving = [Prescribed(name, speed) for name in ("left", "top", "bottom")]
    with Fluid(domain, model, [Open("right"), *moving], reynolds=5.0) as fluid:
        solve_steady(fluid, 1e-11)
        u = ufl.split(fluid.state)[0]
        off = u - ufl.as_vector([ufl.ln(1 + height) / np.log(2.0), 0.0])
        assert integral(domain, ufl.inner(off, off) * ufl.dx) < 1e-5**2
        stress = 1 / (5.0 * np.log(2.0))
        drag = TractionProbe(fluid, "bottom", (0.0, 0.0)).surface_resultant().force[0]
        assert drag == pytest.approx(stress, rel=1e-3)
        assert dissipation(fluid) == pytest.approx(stress, rel=1e-5)


def couette_couples(around: int) -> tuple[float, float]:
    """Torques on the inner disc by the residual and by the surface integral; see the test below."""
    turning = Prescribed("inner", lambda x, t: np.vstack([-x[1], x[0]]))
    with Fluid(
        ring(0.5, 1.0, around, 2), FlowModel(), [turning, no_slip("outer")], reynolds=4.0
    ) as fluid:
        solve_steady(fluid, 1e-11)
        probe = TractionProbe(fluid, "inner", (0.0, 0.0))
        return float(probe.resultant().torque[2]), float(probe.surface_resultant().torque[2])


def test_couple_between_turning_discs_converges_at_the_doubled_rate() -> None:
    """Circular Couette flow, inner disc (radius a = 1/2) turning at omega = 1, outer (b = 1) at rest.

    Per unit depth the fluid turns the inner disc with -4 pi mu omega a^2 b^2 / (b^2 - a^2) (Landau & Lifshitz,
    section 18); here mu = 1/4. P2-P1 on quadratic cells: order 2k = 4, the surface integral at most 3.
    """
    exact = -4 * np.pi * 0.25 * (0.25 / 0.75)
    off = np.array([np.abs(np.array(couette_couples(n)) - exact) for n in [16, 32, 64]])
    by_residual, by_integral = (-np.diff(np.log2(column)) for column in off.T)
    # Between 32 and 64 cells around the next term of the error makes 0.15 of an order.
    assert by_residual[-1] == pytest.approx(4.0, abs=0.2)
    assert by_integral[-1] < 3.3
    assert off[-1, 0] < 0.01 * off[-1, 1]


# A node where the wall meets the inflow also carries the inflow's traction: Simpson's weight of half an edge.
CORNER = 0.25 / 6


@pytest.mark.parametrize(
    ("profile", "by_integral", "drag"),
    [
        # v = (y, 0), p = 0: the shear stress 1/Re on the wall and on the inflow.
        (lambda y: y, [0.1, 0.0, 0.0], 0.1),
        # v = (6 y (1 - y), 0), p = (12/Re) (1 - x): shear stress 6/Re, the mean pressure 6/Re presses; on the inflow
        # the pressure 12/Re pushes the fluid on.
        (lambda y: 6 * y * (1 - y), [0.6, -0.6, 0.0], 0.6 - 1.2 * CORNER),
    ],
)
def test_wall_under_plane_couette_and_poiseuille_flow(
    profile: Any, by_integral: list[float], drag: float
) -> None:
    """Force of a parallel flow on the bottom of the unit square, four cells long, Re = 10: both ways."""
    sides = [Prescribed(name, stream(profile)) for name in ("left", "top", "bottom")]
    with Fluid(unit_box(2, 4), FlowModel(), [Open("right"), *sides], reynolds=10.0) as fluid:
        solve_steady(fluid, 1e-12)
        probe = TractionProbe(fluid, "bottom", (0.0, 0.0))
        assert probe.surface_resultant().force == pytest.approx(by_integral, abs=1e-12)
        assert probe.resultant().force[0] == pytest.approx(drag, abs=1e-12)


# -- torques and the traction field -------------------------------------------------------------


def test_the_traction_field_vanishes_off_the_body() -> None:
    """On it the field adds up to the resultant, see the test on a reference map."""
    with past_square(square_in_box(SIZE, 0.25), FlowModel()) as fluid:
        solve_steady(fluid, 1e-10)
        values = TractionProbe(fluid, "body", (0.8, 0.55)).field().x.array.reshape(-1, 2)
        away = np.abs(fluid.space.velocity_points()[:, :2] - [0.8, 0.55]).max(axis=1)
    assert np.all(values[away > 0.5 * SIZE + 1e-9] == 0.0) and np.abs(values).max() > 0.1


# -- on a reference map -------------------------------------------------------------------------


def bulge(x: np.ndarray) -> np.ndarray:
    """A displacement that moves the square, turns it somewhat and leaves the outer boundary alone."""
    height = np.sin(0.5 * np.pi * x[0]) * np.sin(np.pi * x[1])
    return height * np.array([0.1 + 0.3 * (x[1] - 0.5), 0.15 * x[0] - 0.05])


def probed(fluid: Fluid) -> list[np.ndarray]:
    """Forces and torques, both ways, and the integral of the traction field."""
    solve_steady(fluid, 1e-11)
    probe = TractionProbe(fluid, "body", (0.7, 0.5))
    readings = [probe.resultant(), probe.surface_resultant()]
    normal = forms.surface_vector(ufl.FacetNormal(fluid.domain.mesh), fluid.reference_map)
    area = ufl.sqrt(ufl.inner(normal, normal))
    total = [integral(fluid.domain, t * area * fluid.domain.measure("body")) for t in probe.field()]
    return [*(part for r in readings for part in (r.force, r.torque)), np.array(total)]


def test_same_force_on_a_reference_map_as_on_the_moved_mesh() -> None:
    domain = square_in_box(SIZE, 0.3)
    mesh = domain.mesh
    d = geometry_function(mesh)
    d.interpolate(bulge)
    at_rest = dolfinx.fem.Constant(mesh, (0.0, 0.0))
    with past_square(domain, FlowModel(reference_map=forms.ReferenceMap.of(d, at_rest))) as fluid:
        on_map = probed(fluid)
    mesh.geometry.x[geometry_rows(d), :2] += d.x.array.reshape(-1, 2)
    with past_square(domain, FlowModel()) as fluid:
        moved = probed(fluid)
    for a, b in zip(on_map, moved, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9)
    assert on_map[-1] == pytest.approx(on_map[0][:2], rel=1e-9)


# -- three dimensions ---------------------------------------------------------------------------


RADIUS, CENTRE = 0.25, np.array([[0.6], [0.5], [0.5]])  # of `ball_in_box`


def stokes(x: np.ndarray, time: float) -> np.ndarray:
    """Velocity of creeping flow past a fixed sphere in an unbounded uniform flow along x (Batchelor 1967, 4.9)."""
    away = x - CENTRE
    r = np.linalg.norm(away, axis=0)
    along, a = np.array([[1.0], [0.0], [0.0]]), RADIUS
    uniform = 1.0 - 0.75 * a / r - 0.25 * a**3 / r**3
    return uniform * along - (0.75 * a / r**3 - 0.75 * a**3 / r**5) * away[0] * away


def test_a_third_of_the_drag_of_a_sphere_in_creeping_flow_is_pressure() -> None:
    """Stokes: 6 pi mu a U in all, 2 pi mu a U of pressure and 4 pi mu a U of viscous stress; no torque.

    Nothing but the boundaries acts on the flow: the forces on body and outer boundary sum to zero, exactly so by the
    residual (a constant test function has no strain).
    """
    errors = []
    for cell in (0.5, 0.25):
        around = [Prescribed("outer", stokes), no_slip("body")]
        with Fluid(ball_in_box(cell), FlowModel(inertia=False), around, reynolds=1.0) as fluid:
            fluid.solve(1e-10)
            probe, outer = (TractionProbe(fluid, n, CENTRE[:, 0]) for n in ("body", "outer"))
            whole, viscous = probe.surface_resultant(), probe.surface_resultant(viscous=True)
            drag = probe.resultant().force
            assert outer.resultant().force == pytest.approx(-drag, abs=1e-9 * drag[0])
        parts = np.array([whole.force - viscous.force, viscous.force])
        exact = np.array([[2.0, 0.0, 0.0], [4.0, 0.0, 0.0]]) * np.pi * RADIUS
        errors.append(np.linalg.norm(parts - exact, axis=1) / np.linalg.norm(exact, axis=1))
        assert np.abs([whole.torque, viscous.torque]).max() < 0.02 * np.pi * RADIUS**2
    # Measured: 1.6% of the pressure part and 4.7% of the viscous one, which halve at least with the cells.
    assert (errors[1] < 0.05).all() and (errors[1] < 0.5 * errors[0]).all(), errors
