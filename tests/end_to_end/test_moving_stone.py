"""Grains that move in a turbulent open channel: their momentum and the flow's, new meshes, paths."""

import numpy as np
import pytest
from mpi4py import MPI
from test_large_grain import stone
from test_large_grain_in_space import stone as solid_stone
from test_rough_beds import moving as over_rough_waves
from turbulent import balance

import incipient
from incipient.geometry.placement import Placement
from incipient.interrupt import Interruption
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Fluid,
    Gravity,
    Numerics,
    OpenChannel,
    Output,
    Poiseuille,
    RidgeBed,
    Scene,
    Sinusoidal,
    Sphere,
    Time,
)
from incipient.setup.setup import Setup
from incipient.simulation.build import prepared
from incipient.simulation.state import Recorder
from incipient.simulation.time_loop import TimeLoop


def moving(end, step, density=2.65, remesh_below=0.35, output=None, mesh_size=4.0, **changes):
    """The stone of 0.2 of the depth, free in the stream 0.15 above the bed, which is set going at once."""
    sections = {
        "body": Disc(diameter=0.2, centre=(1.9375, 0.25), motion="free", density=density),
        "gravity": Gravity(acceleration=1.0),
        "time": Time(end=end, step=step),
        "numerics": Numerics(
            mesh_size=mesh_size, order=2, error_bars=False, remesh_below=remesh_below
        ),
        "output": output or Output(fields=False),
    }
    return stone(**{**sections, **changes})


def balances(scene):
    """What the body's momentum gains in the last step of a run, the flow's load and the rest of it, (gdim,) each.

    Then the load along the stream by the walls, what it leaves of the stream, and what the stream loses.
    """
    with prepared(scene, MPI.COMM_SELF) as run:
        TimeLoop(run, Recorder(), Interruption(run.comm)).set_up()
        steps = list(run.transient.march(scene.time.end, scene.time.step))
        fluid, grain, gdim = run.fluid, run.grain, scene.gdim
        past = grain.past
        borne, lost = balance(fluid, ("body", "bed"))
        load, state = grain.end.flow_load[:gdim], past[0]
        mass = grain.body.inertia.mass
        gained = mass * sum(
            float(a.value) * one.velocity for a, one in zip(fluid.rate, past, strict=True)
        )
        weight = (mass - scene.grain.volume) * np.array(scene.gravity_vector)
    assert len(steps) == 2 and steps[-1].report.residuals[-1] < 1e-5
    assert state.velocity[0] > 0.5
    return gained, load, weight, np.array(borne), lost


@pytest.mark.slow
def test_a_stone_and_the_stream_exchange_momentum():
    """Mass times acceleration is flow and weight, by the flow's own differences; what grain and bed bear it loses."""
    exactly = Numerics(mesh_size=4.0, order=2, error_bars=False, tolerance=1e-10)
    gained, load, weight, borne, lost = balances(moving(4e-3, 2e-3, numerics=exactly))
    size = abs(load[0])
    assert load[0] == pytest.approx(borne[0], rel=1e-10)
    assert borne.sum() == pytest.approx(lost, abs=1e-4 * size)
    assert gained == pytest.approx(load + weight, abs=1e-11 * size)


def test_a_wall_on_top_is_met_where_the_mesh_ends_at_it():
    """The law of the wall on top begins below it, and so does contact; the bed bounds the mesh itself."""
    scene = moving(1.0, 0.1, flow=Poiseuille())
    near = Setup(scene).clearance(Placement((1.9375, 0.85)))
    assert near.other == "top"
    assert near.distance == pytest.approx(1.0 - Setup(scene).walls.distance("top") - 0.95)


def test_the_stream_enters_above_the_bed_that_is_meshed():
    """Ridges 0.04 high have a trough at the inflow; level ground as high as their crests takes its place there."""
    setup = Setup(
        solid_stone(
            domain=Domain(length=4.0, width=1.2, height=1.0),
            body=Sphere(diameter=0.4, x=1.875, density=2.65),
            bed=RidgeBed(amplitude=0.04, wavelength=0.5),
        )
    )
    assert setup.walls.datum == pytest.approx(0.04, abs=1e-12)
    assert setup.walls.depth == pytest.approx(0.96)


def released(density, step=0.01, end=0.01, **changes):
    """The stone let go in the steady flow around it."""
    time = Time(end=end, step=step, start="steady", **changes)
    return incipient.run(moving(end, step, density, time=time))


@pytest.mark.slow
def test_a_stone_let_go_begins_with_the_load_on_it_when_held():
    """(m + m_a) dU/dt is the load when held, and weight: stones of two densities agree on it and on the added mass.

    That of a disc is the fluid it displaces, and 5 to 25% more next to a bed 2.5 radii from its centre.
    """
    held = incipient.run(moving(1, 1, body=Disc(diameter=0.2, centre=(1.9375, 0.25)), time=None))
    area, weight = 0.01 * np.pi, np.array([0.0, -0.01 * np.pi])
    first = 1e-3
    result = {density: released(density, first, first) for density in (0.3, 2.65)}
    gained = {
        density: np.array(one.trajectory["velocity"]) / first for density, one in result.items()
    }
    for density, one in result.items():
        balance = density * area * gained[density] - (density - 1.0) * weight
        assert balance == pytest.approx(one.force.flow[:2], rel=1e-5)
    light, heavy = (one.force.flow[:2] for one in result.values())
    added = (heavy - light) / (gained[0.3] - gained[2.65])
    assert (1.05 * area < added).all() and (added < 1.25 * area).all()
    assert light + added * gained[0.3] == pytest.approx(held.force.flow[:2], rel=0.02)


# Sand by k-omega SST, whose cells reach into the viscous sublayer.

COURSE = ("0.8*(1-exp(-t/0.02))", "0.2*(1-exp(-t/0.02))", "0.3")


def over_waves(end, step, start="steady", remesh_below=0.35, mesh_size=2.8, **body):
    """A disc over a wavy bed four diameters deep, on a course by default."""
    grain = {
        "diameter": 1.0,
        "centre": (3.0, 1.2),
        "motion": "prescribed",
        "course": COURSE,
        **body,
    }
    if grain["motion"] != "prescribed":
        del grain["course"]
    return Scene(
        domain=Domain(length=6.0, height=4.0),
        fluid=Fluid(reynolds=600.0, scale="flow"),
        flow=OpenChannel(),
        bed=Sinusoidal(amplitude=0.08, wavelength=1.0),
        body=Disc(**grain),
        gravity=Gravity(acceleration=0.2),
        contact=Contact(friction=0.6),
        effects=Effects(turbulence=True),
        turbulence={"model": "k-omega-sst"},
        time=Time(end=end, step=step, start=start),
        numerics=Numerics(
            order=2, error_bars=False, mesh_size=mesh_size, remesh_below=remesh_below
        ),
        output=Output(fields=False),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    [
        lambda **body: over_waves(0.1, 0.05, "rest", **body),
        lambda motion, **body: over_rough_waves(motion, 0.1, **body),
    ],
    ids=["smooth", "rough"],
)
def test_a_grain_on_a_course_of_no_way_is_one_that_is_held(scene):
    """On a mesh that may move, but does not; also what both say of the walls."""
    held = incipient.run(scene(motion="fixed"))
    by_course = incipient.run(scene(motion="prescribed", course=("0",) * 3))
    assert by_course.force.flow == pytest.approx(held.force.flow, rel=1e-6)
    assert by_course.turbulence.largest == pytest.approx(held.turbulence.largest, rel=1e-6)


def test_on_a_new_mesh_k_is_at_least_what_is_not_destroyed():
    """In clefts it falls without end, and ln k by e-folds from node to node, with which no time step was found."""
    scene = over_waves(0.1, 0.05, "rest", motion="fixed")
    finer = over_waves(0.1, 0.05, "rest", motion="fixed", mesh_size=2.0)
    with prepared(scene, MPI.COMM_SELF) as old, prepared(finer, MPI.COMM_SELF) as new:
        before, after = (run.turbulence for run in (old, new))
        for part in (before, after):
            part.around(None)
        least = np.log(1e-3 * Setup(scene).walls.shear_velocity ** 2)
        values = before.fields.state.x.array.copy()
        values[0::2] = np.where(
            before.fields.space.tabulate_dof_coordinates()[:, 0] < 3.0, -40.0, -5.0
        )
        before.in_time.past = [values, values]
        after.carry_over(before)
        beyond = after.fields.state.x.array[0::2]
        assert beyond.min() == pytest.approx(least)
        assert (beyond < -5.5).mean() > 0.2 and (beyond > -5.5).mean() > 0.2
