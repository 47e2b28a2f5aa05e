"""Both descriptions of one flow are the same to round-off, and a fixed domain pays for no map.

reference  fields on a fixed mesh, displacement d and mesh velocity as functions (`forms.ReferenceMap`)
updated    the mesh moved by d, F = I, still a mesh velocity, in the carrier

Source of the equivalence: (338) and (339) are the updated equations pulled back by x = X + d.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import curved_box, unit_box
from moving import RandomMotion

from incipient import compat, forms
from incipient.compat import petsc
from incipient.fluid import FlowModel, Fluid, Open, Prescribed, no_slip
from incipient.fluid.space import (
    geometry_function,
    geometry_rows,
    taylor_hood,
)
from incipient.fluid.transient import backward_difference
from incipient.forms import terms
from incipient.mesh.domain import Domain, straight_cells

RENEWED = forms.ReferenceMap.renewed(2)


def stokes(flow: Any, viscosity: Any, reference_map: forms.ReferenceMap) -> Any:
    """Stress and continuity of v, p, tested with w, q: the integrand."""
    v, p, w, q = flow
    stress = terms.internal_force(v, p, w, viscosity, reference_map)
    return stress + terms.continuity(v, q, reference_map)


def test_moved_cubic_mesh_has_the_exact_area() -> None:
    """d = (0.2 y^2, 0.3 x y) on cubic cells: the area is int det F = 1 + int (0.3 x - 0.12 y^2) = 1.11.

    Nodes belong to the coordinate element and are found through the cells.
    """
    mesh = curved_box(2, 2, 3).mesh
    d = geometry_function(mesh)
    d.interpolate(lambda x: np.array([0.2 * x[1] ** 2, 0.3 * x[0] * x[1]]))
    mesh.geometry.x[geometry_rows(d), :2] += d.x.array.reshape(-1, 2)
    area = dolfinx.fem.assemble_scalar(compat.form(1.0 * ufl.dx(domain=mesh)))
    assert area == pytest.approx(1.11, abs=1e-14)


def lowered(form: Any) -> Any:
    """The form as UFL hands it to the form compiler, in components."""
    data = ufl.algorithms.compute_form_data(form, do_apply_function_pullbacks=False)
    return ufl.algorithms.expand_indices(data.preprocessed_form)


def nodes_of(form: Any) -> Iterator[Any]:
    """All nodes in the integrands of a form, each once."""
    for integral in form.integrals():
        yield from ufl.corealg.traversal.unique_pre_traversal(integral.integrand())


def test_a_renewed_reference_compiles_to_what_no_map_would_be() -> None:
    """After UFL's lowering neither F, its inverse nor J is left: the integrand is that in grad v alone."""
    with in_a_step(curved_box(2, 2, 1), FlowModel(unsteady=True)) as fluid:
        state, tests = fluid.state, ufl.TestFunctions(fluid.space.mixed)
        renewed = fluid.residual_form(*tests)
        assert set(renewed.coefficients()) == {state, *fluid.history}
        v, p = ufl.split(state)
        w, q = tests
        stress = stokes((v, p, w, q), 1.0, RENEWED) * ufl.dx
        strains = ufl.inner(ufl.sym(ufl.grad(v)), ufl.sym(ufl.grad(w)))
        plain = (2.0 * strains - p * ufl.div(w) - ufl.div(v) * q) * ufl.dx
    sizes = [len(list(nodes_of(lowered(form)))) for form in (stress, plain)]
    assert sizes[0] == sizes[1]
    costly = {ufl.tensoralgebra.Determinant, ufl.tensoralgebra.Inverse, ufl.constantvalue.Identity}
    assert not {type(node) for node in nodes_of(lowered(renewed))} & costly


def test_absent_terms_are_not_in_the_form() -> None:
    """Steady Stokes flow needs the state alone, and no facet integral."""
    with Fluid(unit_box(2, 2), FlowModel(inertia=False), [no_slip("left")], 1.0) as fluid:
        form = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
    assert form.coefficients() == (fluid.state,)
    assert {integral.integral_type() for integral in form.integrals()} == {"cell"}


@pytest.mark.parametrize(("gdim", "expected"), [(2, [3.0]), (3, [2.0, 4.0, 3.0])])
def test_vorticity_of_a_linear_flow(gdim: int, expected: list[float]) -> None:
    """2D: v = (-y, 2 x), curl = 3; 3D: v = (-y + 5 z, 2 x, 2 y + x), curl = (2, 5 - 1, 2 + 1)."""
    x = ufl.SpatialCoordinate(unit_box(gdim, 2).mesh)
    components = [-x[1], 2 * x[0]] if gdim == 2 else [-x[1] + 5 * x[2], 2 * x[0], 2 * x[1] + x[0]]
    curl = forms.vorticity(ufl.as_vector(components))
    parts = [curl] if gdim == 2 else list(curl)
    values = [dolfinx.fem.assemble_scalar(compat.form(part * ufl.dx)) for part in parts]
    assert values == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("normal", "power"), [(-2.0, 20.0), (2.0, 0.0)])
def test_fluid_that_comes_back_through_an_open_boundary_brings_the_momentum_of_the_stream(
    normal: float, power: float
) -> None:
    """Velocity v = (u, 3) in a stream s = (u, -2): the term has the power -u (v - s) . v' with v' = (0, 2) (exact).

    In a stream at rest it brings no momentum.
    """
    domain = unit_box(2, 2)
    v, stream, tested = (dolfinx.fem.Constant(domain.mesh, (normal, y)) for y in (3.0, -2.0, 0.0))
    tested.value[:] = 0.0, 2.0
    n, measure = ufl.FacetNormal(domain.mesh), domain.measure("right")
    returning = terms.entering_boundary(v - stream, v, tested, n) * measure
    assert dolfinx.fem.assemble_scalar(compat.form(returning)) == pytest.approx(power, abs=1e-12)


# -- meshes that move ---------------------------------------------------------------------------

# Radii of the throws of vertices and mid-side nodes, about as far as no cell folds.
THROWS = {(2, 1): (0.16, 0.0), (2, 2): (0.12, 0.03), (3, 1): (0.06, 0.0), (3, 2): (0.05, 0.01)}

# A step of second order, three quarters as long as the one before.
RATE, EXTRAPOLATION = backward_difference(2, 0.3, 0.75)


def in_a_step(domain: Domain, model: FlowModel) -> Fluid:
    """A flow with every term present, past states and a first guess that are random."""
    still = [no_slip(name) for name in ("left", "bottom", "front", "back") if name in domain.names]
    lid = Prescribed("top", lambda x, t: np.vstack([np.full(x.shape[1], 1 + t), *(0 * x[1:])]))
    fluid = Fluid(domain, model, [Open("right"), lid, *still], 7.0)
    random = np.random.default_rng(2)
    for function in (*fluid.history, fluid.state):
        function.x.array[:] = random.standard_normal(len(function.x.array))
    fluid.discretise_time(RATE, EXTRAPOLATION)
    fluid.time = 0.3
    return fluid


def step_of(fluid: Fluid) -> list[np.ndarray]:
    """Residual of the first guess, and the solution; in 3D without, as gmsh's small cubes hold no pressure."""
    residual = fluid.residual()
    if fluid.space.gdim == 3:
        return [residual]
    assert fluid.solve(1e-13).converged
    return [residual, fluid.state.x.array.copy()]


@pytest.mark.parametrize(("gdim", "order"), THROWS)
@pytest.mark.parametrize("convection", ["implicit", "extrapolated"])
def test_step_on_a_moved_mesh_equals_step_on_the_reference(
    gdim: int, order: int, convection: str
) -> None:
    """The reference way, d and its backward difference as functions, and the updated way, the mesh moved."""
    domain = curved_box(gdim, 2, order)
    model = FlowModel(
        unsteady=True,
        convection=convection,
        body_force=lambda x, t: (1 + t) * x,
        stabilisation=gdim == 2,  # in space it takes long to compile
    )
    motion = RandomMotion(domain.mesh, *THROWS[gdim, order], boundary="free")
    meshes = [motion.places() for _ in RATE]
    d, v_mesh = (geometry_function(domain.mesh) for _ in range(2))
    rates = sum(a * x for a, x in zip(RATE, meshes, strict=True))
    for function, values in ((d, meshes[0] - motion.made), (v_mesh, rates)):
        function.x.array[:] = values[geometry_rows(function), : domain.gdim].ravel()
    with in_a_step(domain, replace(model, reference_map=forms.ReferenceMap.of(d, v_mesh))) as fluid:
        expected = step_of(fluid)
    with in_a_step(domain, replace(model, moving_mesh=True)) as fluid:
        fluid.move_mesh(meshes[0], meshes[0], meshes[0])
        still = fluid.residual()
        fluid.move_mesh(*meshes)
        result = step_of(fluid)
    for a, b in zip(result, expected, strict=True):
        assert np.abs(a - b).max() < 1e-11 * np.abs(b).max()
    # The comparison is not blind: without the mesh velocity the residual differs.
    assert np.abs(still - result[0]).max() > 1e-3 * np.abs(still).max()


def test_measures_of_the_boundary_share_the_facet_tags() -> None:
    """From dolfinx 0.9 on a form whose measures of the boundary hold different tags is refused."""
    sides = [Open("left"), Open("right"), no_slip("bottom"), no_slip("top")]
    with Fluid(unit_box(2, 2), FlowModel(), sides, reynolds=1.0) as fluid:
        form = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
    held = [
        one.subdomain_data() for one in form.integrals() if one.integral_type() == "exterior_facet"
    ]
    assert len(held) == 2
    assert all(tags is held[0] for tags in held)


@pytest.mark.parametrize(("gdim", "order"), [(2, 2), (2, 3), (3, 2)])
def test_straight_cells_take_fewer_points(gdim: int, order: int) -> None:
    """Both measures are exact on straight cells, where the integrands are polynomials, and alike on curved ones."""
    mesh = curved_box(gdim, 3, order).mesh
    x = mesh.geometry.x
    x[:, 1] += 0.3 * np.maximum(x[:, 0] - 0.6, 0.0) ** 2
    number = len(compat.geometry_dofs(mesh))
    assert 0 < len(straight_cells(mesh)) < number
    space = taylor_hood(mesh, order)
    state = dolfinx.fem.Function(space.mixed)
    state.x.array[:] = np.random.default_rng(5).normal(size=len(state.x.array))
    v, p = ufl.split(state)
    result, at = [], forms.ReferenceMap.renewed(gdim)
    for measure in (space.quadrature(), space.quadrature(polynomial=True)):
        w, q = ufl.TestFunctions(space.mixed)
        integrand = stokes((v, p, w, q), 0.1, at) + terms.inertia(v, w, at)
        form = (integrand + terms.convection(v, v, w, at)) * measure
        result.append(petsc.assemble_vector(compat.form(form)).array.copy())
    assert result[1] == pytest.approx(result[0], abs=1e-13 * np.abs(result[0]).max())
