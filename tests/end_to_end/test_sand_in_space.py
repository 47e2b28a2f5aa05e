"""A small grain on a level bed in space by k-omega SST: how sure its loads are, slow streams, ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from turbulent import assert_alike

import incipient
from incipient.accuracy.terms import by_coarser_mesh
from incipient.scene import (
    Box,
    Contact,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    Inclined,
    Numerics,
    OpenChannel,
    Output,
    Scene,
    Sphere,
    SphereBed,
    Turbulence,
)
from incipient.setup.setup import Setup
from incipient.simulation.simulate import loads_of

SAND = {
    "domain": Domain(length=8.0, width=6.0, height=5.0),
    "flow": OpenChannel(),
    "body": Sphere(diameter=1.0, x=3.0, density=2.65),
    "bed": Flat(),
    "gravity": Gravity(acceleration=10.0),
    "contact": Contact(friction=0.5, gap=0.05),
    "effects": Effects(turbulence=True),
    "turbulence": Turbulence(model="k-omega-sst"),
    "output": Output(fields=False),
}


def sand(reynolds, mesh_size, error_bars=False, **changes):
    """The sphere in a stream of a Reynolds number by mean speed and depth."""
    numerics = Numerics(mesh_size=mesh_size, order=2, error_bars=error_bars)
    return Scene(
        **{**SAND, "fluid": Fluid(reynolds=reynolds, scale="flow"), "numerics": numerics, **changes}
    )


@pytest.mark.slow
def test_in_a_slow_stream_loads_are_those_of_laminar_flow():
    """Re 100 by the depth, u* d/nu = 3.5, where k of what enters dies out: beside a run without turbulence."""
    laminar = sand(100.0, 1.0, effects=Effects(turbulence=False), turbulence=None)
    result = assert_alike(sand(100.0, 1.5), laminar, 0.01)
    assert any("laminar by the k-omega model" in one for one in result.plan.warnings)


@pytest.mark.slow
def test_over_an_inclined_bed_the_flow_is_that_over_a_level_one():
    """The slope turns gravity alone."""
    assert_alike(sand(300.0, 3.0, bed=Inclined(slope=5.0)), sand(300.0, 3.0, bed=Flat()), 1e-9)


@pytest.mark.slow
def test_the_error_bar_of_the_mesh_holds_what_a_finer_one_finds():
    """u* d/nu = 22, on cells 1.4 times as large as those of a mesh that is compared with."""
    scene = sand(1500.0, 1.1 * 2**0.5)

    def solve(one):
        return loads_of(one, MPI.COMM_WORLD)

    result, finer = solve(scene), solve(sand(1500.0, 1.1))
    term = by_coarser_mesh(scene, result, solve)
    assert (abs(result.force - finer.force) <= term.force).all()
    assert (abs(result.torque - finer.torque) <= term.torque).all()


@pytest.mark.slow
def test_an_accuracy_is_reached_and_a_finer_mesh_agrees():
    """u* d/nu = 22: the first three meshes give the first estimate; a run on cells of 0.78 is within it.

    No other program has been asked: the finer mesh is of this one (docs/contribute/defaults.md).
    """
    numerics = Numerics(order=2, accuracy=0.12, accuracy_of="force", error_bars=False)
    result = incipient.run(sand(1500.0, 1.0).model_copy(update={"numerics": numerics}))
    assert result.adaptation is not None and result.adaptation.met
    assert [trial.note for trial in result.adaptation.trials][:3] == [
        f"mesh_size {size}" for size in ("3.2", "2.26", "1.6")
    ]
    finer, error = np.array([0.1776, 0.0, 0.0567]), result.adaptation.reached
    assert np.linalg.norm(result.force.flow - finer) < error * np.linalg.norm(finer) < 0.12 * 0.187


@pytest.mark.slow
def test_error_bars_say_which_of_them_cells_are_too_large_for():
    """u* d/nu = 22: gap and domain by coarse runs on these cells; no verdict is certain of the model."""
    bars = incipient.run(sand(1500.0, 3.0, True)).error_bars
    assert bars is not None and bars.failed.keys() == {"discretisation"}
    assert bars.failed["discretisation"].endswith("use numerics.mesh_size = 1.6 or less")
    assert [term.name for term in bars.terms] == ["gap", "domain"]
    assert all((term.force[[0, 2]] > 0.0).all() and term.force[1] == 0.0 for term in bars.terms)
    assert bars.safety is not None and not bars.safety.certain


@pytest.mark.slow
def test_a_cube_begins_to_slide_where_friction_no_longer_holds_it():
    """Drag is friction times the weight under water less lift; a run at that speed from the start says the same."""

    def cube(reynolds, acceleration):
        body = Box(sides=(1.0, 1.0, 1.0), x=3.0, density=2.65)
        return sand(reynolds, 3.0, body=body, gravity=Gravity(acceleration=acceleration))

    result = incipient.threshold(cube(1500.0, 0.3))
    drag, across, lift = result.load.flow_force
    assert result.mode == "sliding" and len(result.trials) <= 8
    assert across == 0.0 and 0.0 < lift < drag
    assert drag == pytest.approx(0.5 * (1.65 * 0.3 - lift), rel=1e-3)
    there = incipient.run(cube(1500.0 * result.factor, 0.3 / result.factor**2))
    assert there.verdict["safety_factor"] == pytest.approx(1.0, abs=0.01)


POCKET = {
    "domain": Domain(length=9.0, width=5.0, height=5.866),
    "fluid": Fluid(reynolds=300.0, scale="grain"),
    "body": Sphere(diameter=1.0, x=4.0, density=2.5),
    "bed": SphereBed(
        radius=0.5,
        spacing=1.0,
        arrangement="triangular",
        angle=90.0,
        offset=(4.0 + 12.0**-0.5, 3.0),
    ),
}


HEIGHTS = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.4, 3.2, 4.0, 4.7)  # of measured rows


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True, reason="since walls take any first cell loads behind rows differ by 3% and 8%"
)
@pytest.mark.parametrize(
    ("reynolds", "bed", "walls"),
    [
        (300.0, POCKET, {"upstream_roughness": 1.0}),
        (
            1500.0,
            {"body": Sphere(diameter=1.0, centre=(3.0, 3.0, 0.55))},
            {"wall": "rough", "roughness": 0.2},
        ),
    ],
)
def test_rows_measured_in_developed_flow_have_its_loads(reynolds, bed, walls):
    """Behind a bed of spheres and on sand; omega of rows is that of the mixing length, which the model's is not."""
    given = {"model": "k-omega-sst", **walls}
    developed = sand(reynolds, 3.0, turbulence=Turbulence(**given), **bed)
    enters = Setup(developed).walls
    places = np.zeros((3, len(HEIGHTS)))
    places[2] = enters.datum + np.array(HEIGHTS)
    inflow = enters.inflow
    rows = [HEIGHTS, inflow.velocity(places)[0], np.exp(inflow.logarithms(places)[0])]
    given |= {
        "inflow": "profile",
        "profile": np.transpose(rows).tolist(),
        "intensity": 1e-6,
        "length": 0.5,
    }
    measured = sand(reynolds, 3.0, turbulence=Turbulence(**given), **bed)
    result, expected = (incipient.run(scene).force.flow for scene in (measured, developed))
    assert result == pytest.approx(expected, rel=0.02, abs=1e-9)
