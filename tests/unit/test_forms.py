"""The three descriptions of one flow are the same to round-off, and a fixed domain pays for no map.

reference  fields on a fixed mesh, displacement d and mesh velocity as functions (`forms.ReferenceMap`)
updated    the mesh moved by d, F = I, still a mesh velocity: once as a map with d = 0, once in the carrier
Eulerian   the mesh moved by d, no mesh velocity; the same when the map does not change in time

Source of the equivalence: (338) and (339) are the updated equations pulled back by x = X + d.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
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
    TaylorHood,
    boundary_blocks,
    geometry_function,
    set_geometry_function,
    taylor_hood,
)
from incipient.fluid.transient import backward_difference
from incipient.forms import terms
from incipient.mesh.cells import straight_cells
from incipient.mesh.domain import Domain

QUADRATURE = {"quadrature_degree": 6}
ROUND_OFF = 1e-12


def affine(x: np.ndarray) -> np.ndarray:
    """d linear in space, with stretching and shear."""
    return np.array([0.1 * x[0] + 0.3 * x[1], 0.2 * x[0] - 0.1 * x[1], 0.15 * x[2] + 0.1 * x[0]])


def quadratic(x: np.ndarray) -> np.ndarray:
    """d of degree two in space, J between 0.6 and 1.5."""
    return np.array(
        [
            0.2 * x[1] ** 2 + 0.1 * x[0] * x[1],
            0.2 * x[0] * x[1],
            0.1 * x[0] ** 2 + 0.1 * x[1] * x[2],
        ]
    )


RENEWED = forms.ReferenceMap.renewed(2)


def mesh_velocity(x: np.ndarray) -> np.ndarray:
    return np.array([np.sin(x[1]), x[0] ** 2, x[1] * x[2] - x[0]])


def stokes(flow: Any, viscosity: Any, reference_map: forms.ReferenceMap) -> Any:
    """Stress and continuity of v, p, tested with w, q: the integrand."""
    v, p, w, q = flow
    stress = terms.internal_force(v, p, w, viscosity, reference_map)
    return stress + terms.continuity(v, q, reference_map)


@dataclass
class Problem:
    """A flow with every term present, in whatever geometry the mesh has at the moment."""

    domain: Domain
    space: TaylorHood
    displacement: Any
    mesh_velocity: Any
    state: Any
    previous: Any

    def assembled(
        self, reference_map: forms.ReferenceMap, carrier: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residual and Jacobian as arrays."""
        form = self.form(reference_map, carrier)
        vector = petsc.assemble_vector(compat.form(form))
        derivative = ufl.derivative(form, self.state, ufl.TrialFunction(self.space.mixed))
        matrix = petsc.assemble_matrix(compat.form(derivative))
        matrix.assemble()
        return vector.array.copy(), matrix[:, :]

    def form(self, reference_map: forms.ReferenceMap, carrier: Any) -> Any:
        v, p = ufl.split(self.state)
        w, q = ufl.TestFunctions(self.space.mixed)
        mesh = self.domain.mesh
        sides = self.domain.measure("right", "top")
        x = ufl.SpatialCoordinate(mesh) + reference_map.displacement
        viscosity = 1 / dolfinx.fem.Constant(mesh, 7.0)
        force = ufl.as_vector([x[1], x[0] ** 2, x[0] * x[1]][: len(v)])
        rate = 3.0 * (v - ufl.split(self.previous)[0])
        cells = stokes((v, p, w, q), viscosity, reference_map)
        cells += terms.inertia(rate, w, reference_map) + terms.body_force(force, w, reference_map)
        cells += terms.convection(v, carrier, w, reference_map)
        if len(v) == 2:  # in space it takes long to compile
            size = abs(ufl.JacobianDeterminant(mesh)) ** 0.5
            cells += terms.grad_div(v, carrier, w, viscosity, size, reference_map)
        dx = ufl.Measure("dx", domain=mesh, metadata=QUADRATURE)
        open_end = terms.open_boundary(v, w, ufl.FacetNormal(mesh), viscosity, reference_map)
        return cells * dx + open_end * sides(metadata=QUADRATURE)

    @property
    def velocity(self) -> Any:
        return ufl.split(self.state)[0]

    def move(self) -> None:
        """Carry the mesh by d; nodes belong to the coordinate element and are found through the cells."""
        mesh, gdim = self.domain.mesh, self.domain.gdim
        node_to_dof = np.empty(len(mesh.geometry.x), dtype=np.int64)
        node_to_dof[compat.geometry_dofs(mesh)] = compat.cell_dofs(self.displacement.function_space)
        mesh.geometry.x[:, :gdim] += self.displacement.x.array.reshape(-1, gdim)[node_to_dof]


def make_problem(gdim: int, order: int, displacement: Any) -> Problem:
    domain = curved_box(gdim, 2, order)
    space = taylor_hood(domain.mesh, 2)
    d = dolfinx.fem.Function(
        compat.function_space(domain.mesh, compat.coordinate_element(domain.mesh))
    )
    d.interpolate(lambda x: displacement(x)[:gdim])
    v_mesh = dolfinx.fem.Function(space.velocity)
    v_mesh.interpolate(lambda x: mesh_velocity(x)[:gdim])
    state, previous = (dolfinx.fem.Function(space.mixed) for _ in range(2))
    random = np.random.default_rng(1)
    for function in (state, previous):
        function.x.array[:] = random.standard_normal(len(function.x.array))
    return Problem(domain, space, d, v_mesh, state, previous)


def difference(found: Any, expected: Any) -> float:
    """Largest of vector and matrix, relative to the largest entry."""
    return float(
        np.max(
            [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(found, expected, strict=True)]
        )
    )


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize(("order", "displacement"), [(1, affine), (2, quadratic)])
def test_reference_form_equals_updated_form(gdim: int, order: int, displacement: Any) -> None:
    """The comparison is not blind: without the mesh velocity, as in the Eulerian form, the residual differs."""
    problem = make_problem(gdim, order, displacement)
    d, v_mesh, v = problem.displacement, problem.mesh_velocity, problem.velocity
    reference = problem.assembled(forms.ReferenceMap.of(d, v_mesh), v)
    at_rest = problem.assembled(forms.ReferenceMap.of(d, 0 * v_mesh), v)
    problem.move()
    renewed = forms.ReferenceMap.renewed(gdim)
    updated, eulerian = (problem.assembled(renewed, one) for one in (v - v_mesh, v))
    assert difference(reference, updated) < ROUND_OFF
    assert difference(at_rest, eulerian) < ROUND_OFF
    assert difference(updated, eulerian) > 1e-3
    d.x.array[:] = 0.0
    assert difference(problem.assembled(forms.ReferenceMap.of(d, v_mesh), v), updated) < ROUND_OFF


def test_moved_cubic_mesh_has_the_exact_area() -> None:
    """d = (0.2 y^2, 0.3 x y) on cubic cells: the area is int det F = 1 + int (0.3 x - 0.12 y^2) = 1.11."""
    problem = make_problem(2, 3, lambda x: np.array([0.2 * x[1] ** 2, 0.3 * x[0] * x[1]]))
    problem.move()
    area = dolfinx.fem.assemble_scalar(compat.form(1.0 * ufl.dx(domain=problem.domain.mesh)))
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
    problem = make_problem(2, 1, affine)
    renewed = problem.form(RENEWED, problem.velocity)
    mapped = problem.form(
        forms.ReferenceMap.of(problem.displacement, problem.mesh_velocity), problem.velocity
    )
    assert set(renewed.coefficients()) == {problem.state, problem.previous}
    assert len(mapped.coefficients()) == 4
    v, p = ufl.split(problem.state)
    w, q = ufl.TestFunctions(problem.space.mixed)
    stress = stokes((v, p, w, q), 1.0, RENEWED) * ufl.dx
    D = ufl.sym(ufl.grad(v))
    plain = (2.0 * ufl.inner(D, ufl.sym(ufl.grad(w))) - p * ufl.div(w) - ufl.div(v) * q) * ufl.dx
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
    mesh = unit_box(gdim, 2).mesh
    x = ufl.SpatialCoordinate(mesh)
    components = [-x[1], 2 * x[0]] if gdim == 2 else [-x[1] + 5 * x[2], 2 * x[0], 2 * x[1] + x[0]]
    curl = forms.vorticity(ufl.as_vector(components))
    parts = [curl] if gdim == 2 else list(curl)
    values = [dolfinx.fem.assemble_scalar(compat.form(part * ufl.dx)) for part in parts]
    assert values == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("gdim", "mapped"), [(2, True), (3, False)])
def test_stokes_operator_is_symmetric_also_with_an_open_boundary(gdim: int, mapped: bool) -> None:
    """The reason for the vanishing div v in the open boundary's term: it is symmetric where v is not prescribed."""
    problem = make_problem(gdim, 1, affine)
    space, domain = problem.space, problem.domain
    v, p = ufl.TrialFunctions(space.mixed)
    w, q = ufl.TestFunctions(space.mixed)
    measure = domain.measure("right")(metadata=QUADRATURE)
    mapping = (
        forms.ReferenceMap.of(problem.displacement, problem.mesh_velocity)
        if mapped
        else forms.ReferenceMap.renewed(gdim)
    )
    dx = ufl.Measure("dx", domain=domain.mesh, metadata=QUADRATURE)
    open_end = terms.open_boundary(v, w, ufl.FacetNormal(domain.mesh), 1 / 7.0, mapping)
    form = stokes((v, p, w, q), 1 / 7.0, mapping) * dx + open_end * measure
    matrix = petsc.assemble_matrix(compat.form(form))
    matrix.assemble()
    prescribed = [
        boundary_blocks(space.velocity, domain.facets_of(name))
        for name in domain.names
        if name != "right"
    ]
    held = gdim * np.concatenate(prescribed)[:, None] + np.arange(gdim)
    free = np.delete(np.arange(space.unknowns), space.velocity_map[held.ravel()])
    entries = matrix[:, :][np.ix_(free, free)]
    assert np.abs(entries - entries.T).max() < ROUND_OFF * np.abs(entries).max()


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
CELLS = pytest.mark.parametrize(("gdim", "order"), THROWS)


def thrown_about(domain: Domain, order: int) -> RandomMotion:
    return RandomMotion(domain.mesh, *THROWS[domain.gdim, order], boundary="free")


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


@CELLS
@pytest.mark.parametrize("convection", ["implicit", "extrapolated"])
def test_step_on_a_moved_mesh_equals_step_on_the_reference(
    gdim: int, order: int, convection: str
) -> None:
    """The reference way, d and its backward difference as functions, and the updated way, the mesh moved."""
    domain = curved_box(gdim, 2, order)
    model = FlowModel(unsteady=True, convection=convection, body_force=lambda x, t: (1 + t) * x)
    motion = thrown_about(domain, order)
    meshes = [motion.places() for _ in RATE]
    d, v_mesh = (geometry_function(domain.mesh) for _ in range(2))
    set_geometry_function(d, meshes[0] - motion.made)
    set_geometry_function(v_mesh, sum(a * x for a, x in zip(RATE, meshes, strict=True)))
    with in_a_step(domain, replace(model, reference_map=forms.ReferenceMap.of(d, v_mesh))) as fluid:
        expected = step_of(fluid)
    with in_a_step(domain, replace(model, moving_mesh=True)) as fluid:
        domain.mesh.geometry.x[:] = meshes[0]
        fluid.mesh_moved(*meshes[1:])
        found = step_of(fluid)
    for a, b in zip(found, expected, strict=True):
        assert np.abs(a - b).max() < 1e-11 * np.abs(b).max()


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
    found, at = [], forms.ReferenceMap.renewed(gdim)
    for measure in (space.quadrature(), space.quadrature(polynomial=True)):
        w, q = ufl.TestFunctions(space.mixed)
        integrand = stokes((v, p, w, q), 0.1, at) + terms.inertia(v, w, at)
        form = (integrand + terms.convection(v, v, w, at)) * measure
        found.append(petsc.assemble_vector(compat.form(form)).array.copy())
    assert found[1] == pytest.approx(found[0], abs=1e-13 * np.abs(found[0]).max())
