"""Stabilised convection: consistent, dissipative, absent unless asked for; asked for where cells are coarse."""

from __future__ import annotations

from pathlib import Path

import dolfinx
import numpy as np
import pytest
import ufl
from domains import SIDES, unit_box

from incipient import Scene, compat, load
from incipient.effects.plan import make_plan
from incipient.fluid import FlowModel, Fluid, no_slip
from incipient.fluid.derived import measured_cell_reynolds
from incipient.forms import ReferenceMap, terms
from incipient.planning.flow_setup import Setup
from incipient.planning.stabilisation import COARSE, cell_reynolds, largest_peclet


def scene(reynolds: float, **numerics: object) -> Scene:
    return Scene(
        domain={"kind": "box", "length": 1.0, "height": 1.0},
        fluid={"reynolds": reynolds, "scale": "flow"},
        flow={"kind": "lid"},
        numerics=numerics,
    )


# -- the term -----------------------------------------------------------------------------------


def fluid(stabilisation: bool, **more: object) -> Fluid:
    model = FlowModel(stabilisation=stabilisation, **more)  # type: ignore[arg-type]
    return Fluid(unit_box(2, 4), model, [no_slip(name) for name in SIDES[:4]], 1e4)


def energy_taken(velocity: str) -> float:
    """What the stabilisation takes from a flow: its residual tested with the velocity."""
    fields = {
        "solenoidal": lambda x: np.vstack([x[1] ** 2, x[0] ** 2]),
        "expanding": lambda x: np.vstack([x[0] ** 2, x[1]]),
    }
    taken = []
    for on in (False, True):
        with fluid(on) as found:
            found.state.sub(0).interpolate(fields[velocity])
            form = found.residual_form(*ufl.TestFunctions(found.space.mixed))
            power = ufl.replace(form, {form.arguments()[0]: found.state})
            taken.append(dolfinx.fem.assemble_scalar(compat.form(power)))
    return float(taken[1] - taken[0])


def test_nothing_is_taken_from_a_flow_without_divergence() -> None:
    assert energy_taken("solenoidal") == pytest.approx(0.0, abs=1e-14)


def test_energy_is_taken_from_divergence() -> None:
    assert energy_taken("expanding") > 1e-3


@pytest.mark.parametrize("more", [{"inertia": False}, {}])
def test_an_absent_term_is_not_in_the_form(more: dict[str, bool]) -> None:
    """Without it, and in Stokes flow with it, the code generated is that of a fluid that knows no such term."""
    with fluid(False, **more) as plain, fluid(not more.get("inertia", True), **more) as other:
        forms = [
            found.residual_form(*ufl.TestFunctions(found.space.mixed)) for found in (plain, other)
        ]
    signatures = [
        str(form.integrals()[0].integrand()).count("JacobianDeterminant") for form in forms
    ]
    assert signatures == [0, 0]


def test_a_reference_map_gives_what_the_moved_mesh_gives() -> None:
    """x = 2 X: the integral over the map's domain and that over a domain twice as large."""
    values = []
    for scale in (1.0, 2.0):
        domain = unit_box(2, 3)
        mesh = domain.mesh
        mesh.geometry.x[:] *= scale
        x = ufl.SpatialCoordinate(mesh)
        still = ufl.as_vector([0.0 * x[0], 0.0 * x[0]])
        mapped = ReferenceMap.of(x, still) if scale == 1.0 else ReferenceMap.renewed(2)
        place = (3.0 - scale) * x
        v = ufl.as_vector([place[0] ** 2, place[1]])
        size = abs(ufl.JacobianDeterminant(mesh)) ** 0.5
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 8})
        values.append(
            dolfinx.fem.assemble_scalar(
                compat.form(terms.grad_div(v, v, v, 0.01, size, mapped) * dx)
            )
        )
    assert values[0] == pytest.approx(values[1], rel=1e-12)


def test_no_carrier_no_stabilisation() -> None:
    with fluid(False, inertia=False) as plain, fluid(True, inertia=False) as asked:
        for one in (plain, asked):
            one.state.x.array[:] = np.random.default_rng(1).random(len(one.state.x.array))
        assert (plain.residual() == asked.residual()).all()


# -- the decision -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reynolds", "mesh_size", "present"), [(1000, 1.0, False), (1000, 6.0, True), (1e4, 1.0, True)]
)
def test_auto_goes_by_the_reynolds_number_of_cells(
    reynolds: float, mesh_size: float, present: bool
) -> None:
    """48 columns of P2: h = 1/48; at Re = 1e4 1.78 times as many."""
    told = make_plan(scene(reynolds, mesh_size=mesh_size)).stabilisation
    crowd = max(1.0, (reynolds / 1000) ** 0.25)
    assert told.cell_reynolds == pytest.approx(reynolds * mesh_size / (48 * crowd * 2))
    assert told.present is present is (told.cell_reynolds > COARSE)
    assert f"{told.cell_reynolds:.3g}" in make_plan(scene(reynolds, mesh_size=mesh_size)).text()


@pytest.mark.parametrize("asked", ["on", "off"])
def test_the_scene_may_decide(asked: str) -> None:
    told = make_plan(scene(1000, stabilisation=asked)).stabilisation
    assert told.present is (asked == "on")
    assert f'"{asked}"' in told.reason


def test_stokes_flow_needs_none() -> None:
    creeping = scene(1e6).model_copy(
        update={"fluid": scene(1e6).fluid.model_copy(update={"inertia": False})}
    )
    assert not make_plan(creeping).stabilisation.present


def test_measured_cell_reynolds() -> None:
    """A stream of speed 2 through cells of which two make a square of side 1/4: 2/4/2 times 1e4."""
    with fluid(False) as found:
        found.state.sub(0).interpolate(lambda x: np.vstack([2 + 0 * x[0], 0 * x[0]]))
        squares = unit_box(2, 4).mesh.topology.index_map(2).size_global / 16
        side = (0.0625 * 2 / squares) ** 0.5
        assert measured_cell_reynolds(found) == pytest.approx(2 * side / 2 * 1e4, rel=1e-6)
    assert cell_reynolds(Setup(scene(1000))) < COARSE


CYLINDER = Path(__file__).parents[2] / "demos/scenes/cylinder_in_space.toml"


@pytest.mark.parametrize(("reynolds", "solver"), [(20, "block"), (60, "direct")])
def test_blocks_do_without_upwinding_where_cells_are_fine(reynolds: float, solver: str) -> None:
    """The largest cells are a quarter of the channel's height, and their Peclet number 0.45 h/(4 nu)."""
    found = load(CYLINDER, [f"fluid.reynolds={reynolds}"])
    assert largest_peclet(Setup(found)) == pytest.approx(
        0.45 * 0.25 * 0.41 / (4 * 0.02 / reynolds), rel=1e-2
    )
    plan = make_plan(found)
    assert plan.solver.name == solver and not plan.stabilisation.present
    auto = make_plan(load(CYLINDER, [f"fluid.reynolds={reynolds}", "numerics.stabilisation=auto"]))
    assert auto.solver.name == "block" and auto.stabilisation.upwind
