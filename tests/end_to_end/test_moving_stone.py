"""A large grain that moves in a turbulent open channel: its momentum and the stream's, new meshes, going on."""

import csv

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from test_large_grain import integral, stone

import incipient
from incipient.geometry.placement import Placement
from incipient.planning.clearance import surroundings
from incipient.planning.turbulence import walls_of
from incipient.progress import Silent
from incipient.scene import Disc, Gravity, Numerics, Output, Poiseuille, Time
from incipient.simulation.build import prepared
from incipient.simulation.moving_grain import Trajectory


def moving(end, step, density=2.65, remesh_below=0.35, output=None, mesh_size=4.0, **changes):
    """The stone of 0.2 of the depth, free in the stream 0.15 above the bed, which is set going at once."""
    sections = {
        "body": Disc(diameter=0.2, centre=(1.9375, 0.25), motion="free", density=density),
        "gravity": Gravity(acceleration=1.0),
        "time": Time(end=end, step=step),
        "numerics": Numerics(mesh_size=mesh_size, order=2, error_bars=False, remesh_below=remesh_below),
        "output": output or Output(fields=False),
    }
    return stone(**{**sections, **changes})


def column(directory, name):
    with (directory / "history.csv").open(newline="") as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def test_a_stone_and_the_stream_exchange_momentum():
    """Mass times acceleration is flow and weight, by the flow's own differences; what grain and bed bear it loses."""
    with prepared(moving(4e-3, 2e-3), MPI.COMM_SELF) as run:
        parts = (run.scene, run.plan, run.fluid, run.accounts.ledger.stage, Silent())
        travel = Trajectory(*parts, turbulence=run.turbulence)
        run.march_with(travel.transient, travel)
        steps = list(travel.steps())
        fluid, domain, past = run.fluid, run.domain, travel.part.past
        v, _ = ufl.split(fluid.state)
        rate = sum(
            a * ufl.split(one)[0][0] for a, one in zip(fluid.rate, [fluid.state, *fluid.history], strict=True)
        )
        inertia = rate + ufl.dot(ufl.grad(v), fluid.carrier(v))[0]
        reaction = fluid.residual()[fluid.space.velocity_map[::2]].sum()
        n = ufl.FacetNormal(domain.mesh)
        turned = ufl.dot(ufl.grad(v).T, n)[0] - ufl.div(v) * n[0]
        leaving = integral(domain, fluid.viscosity * turned * domain.measure("outflow"))
        x = ufl.as_vector([1.0, 0.0])
        borne = [integral(domain, fluid.walls.power(fluid.state, x, name)) for name in ("body", "bed")]
        load = travel.part.end.flow_load
        gained = 2.65 * sum(float(a.value) * one.velocity for a, one in zip(fluid.rate, past, strict=True))
        carried = integral(domain, inertia * fluid.quadrature())
    assert len(steps) == 2 and steps[-1].report.residuals[-1] < 1e-5
    assert load[0] == pytest.approx(borne[0], rel=1e-10)
    assert sum(borne) == pytest.approx(reaction - carried + leaving, abs=1e-6 * abs(reaction))
    assert gained * 0.01 * np.pi == pytest.approx(
        load[:2] - [0.0, 1.65 * 0.01 * np.pi], abs=1e-6 * abs(load[0])
    )
    assert (past[0].velocity[0], past[0].spin[0]) > (0.5, 0.0)


@pytest.mark.slow
def test_a_run_with_new_meshes_goes_on_where_it_was_kept(tmp_path):
    """Kept after three steps, with a new mesh after each, and gone on with: it ends where the whole run does."""

    def until(end):
        return moving(end, 1e-3, remesh_below=0.998, output=Output(fields=False, checkpoint=3))

    whole = incipient.run(until(5e-3), tmp_path / "whole")
    incipient.run(until(3e-3), tmp_path / "cut")
    resumed = incipient.resume(tmp_path / "cut", ["time.end=5e-3"])
    assert len(whole.trajectory["remeshings"]) == 4
    assert resumed.force.flow == pytest.approx(whole.force.flow, rel=1e-10, abs=1e-12)
    for name in ("x", "velocity_x", "spin", "y_plus_max", "mesh_quality"):
        assert column(tmp_path / "cut", name) == pytest.approx(column(tmp_path / "whole", name), rel=1e-10)


@pytest.mark.slow
def test_new_meshes_leave_the_load_as_it_is(tmp_path):
    """A mesh after each of ten steps, or one for all: after the impulse loads differ by 3%, velocities by 1e-4."""
    ends = []
    for below in (0.35, 0.97):
        directory = tmp_path / str(below)
        incipient.run(moving(0.1, 0.01, remesh_below=below), directory)
        names = ("velocity_x", "velocity_y", "force_x", "force_y", "meshes")
        ends.append([column(directory, name)[4:] for name in names])
    (*one, _), (*many, meshes) = np.array(ends)
    assert meshes[-1] > 7
    assert many[0] == pytest.approx(one[0], abs=1e-4) and many[1] == pytest.approx(one[1], abs=1e-4)
    assert many[2] == pytest.approx(one[2], rel=0.03) and many[3] == pytest.approx(one[3], rel=0.03)


def test_a_wall_on_top_is_met_where_the_mesh_ends_at_it():
    """The law of the wall on top begins below it, and so does contact; the bed bounds the mesh itself."""
    scene = moving(1.0, 0.1, flow=Poiseuille())
    near = surroundings(scene).clearance(Placement((1.9375, 0.85)))
    assert near.other == "top"
    assert near.distance == pytest.approx(1.0 - walls_of(scene).distance - 0.95)
