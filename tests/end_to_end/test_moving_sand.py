"""Sand that moves in a turbulent open channel by k-omega SST: paths, new meshes, resumed runs, ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.special import k0, k1
from turbulent import changes_by_new_meshes, ends_on_ranks, resumed_and_whole

import incipient
from incipient.planning.flow_setup import Setup
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    LogLaw,
    Numerics,
    OpenChannel,
    Output,
    Scene,
    Sinusoidal,
    Time,
)
from incipient.scene.file import dumps
from incipient.simulation.build import prepared
from incipient.turbulence.developed import developed

COURSE = ("0.8*(1-exp(-t/0.02))", "0.2*(1-exp(-t/0.02))", "0.3")


def moving(end, step, start="steady", remesh_below=0.35, checkpoint=0, mesh_size=2.8, **body):
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
        output=Output(fields=False, checkpoint=checkpoint),
    )


def still(motion, start):
    """A grain that is held, or goes along a course of no way."""
    return incipient.run(moving(0.1, 0.05, start, motion=motion, course=("0",) * 3))


@pytest.mark.slow
def test_a_grain_on_a_course_of_no_way_is_one_that_is_held():
    """On a mesh that may move, but does not; also what both say of the walls."""
    held, by_course = (still(motion, "rest") for motion in ("fixed", "prescribed"))
    assert by_course.force.flow == pytest.approx(held.force.flow, rel=1e-6)
    assert by_course.turbulence.largest == pytest.approx(held.turbulence.largest, rel=1e-6)


@pytest.mark.slow
def test_a_run_with_new_meshes_goes_on_where_it_was_kept(tmp_path):
    """Kept after three steps, with a new mesh after each, and gone on with: it ends where the whole run does."""
    names = ("x", "torque", "y_plus_max", "mesh_quality")
    resumed, whole = resumed_and_whole(
        lambda end: moving(end, 0.02, "rest", 0.9995, 3), (0.06, 0.1), tmp_path, names
    )
    assert resumed == [pytest.approx(one, rel=1e-10) for one in whole]


@pytest.mark.slow
def test_moving_sand_on_two_ranks(mpirun, tmp_path):
    """With a new mesh after each step, load and velocity of a free grain are those of one rank."""
    path = tmp_path / "scene.toml"
    scene = moving(0.1, 0.02, "rest", 0.99995, motion="free", density=0.5)
    path.write_text(dumps(scene), encoding="utf-8")
    found = ends_on_ranks(mpirun, path)
    assert found[0][-1] >= 3
    assert found[1] == pytest.approx(found[0], rel=1e-5, abs=1e-8)


@pytest.mark.slow
def test_new_meshes_leave_the_load_as_it_is(tmp_path):
    """Several meshes in twenty steps, or one: loads and velocities change by less than meshes err, as of a stone."""

    def run(many, finer, directory):
        below, size = 0.95 if many else 0.05, {"mesh_size": 2.0 * finer}
        scene = moving(1.0, 0.05, "steady", below, motion="free", density=0.5, **size)
        incipient.run(scene, directory)

    changed, wrong, meshes = changes_by_new_meshes(tmp_path, run, 2)
    assert meshes > 3 and (changed < 2.0 * wrong).all()


def of_disc(q):
    """Added mass of a disc in a step, over the fluid it displaces."""
    return 1.0 + 4.0 * k1(q) / (q * k0(q))


@pytest.mark.slow
def test_sand_let_go_begins_with_the_load_on_it_when_held():
    """(m + m_a) dU/dt is the load when held, and weight: grains of two densities agree on it and on the added mass.

    That in a step of a viscous fluid depends on q = R (nu dt)^(-1/2) (Stokes 1851, his oscillation at a rate of 1/dt),
    and is larger next to a bed 2.4 radii from the centre, below a lid and behind an inflow.
    """
    first, displaced, size = 0.02, 0.25 * np.pi, {"mesh_size": 1.4}
    held = incipient.run(moving(1.0, 1.0, motion="fixed", **size).model_copy(update={"time": None}))
    found = {
        density: incipient.run(moving(first, first, motion="free", density=density, **size))
        for density in (0.3, 2.65)
    }
    along = [0, 1]
    velocities = {
        density: np.array(one.trajectory["velocity"])[along] for density, one in found.items()
    }
    gained = {density: one / first for density, one in velocities.items()}
    weight = np.array([0.0, -0.2 * displaced])
    for density, one in found.items():
        balance = density * displaced * gained[density] - (density - 1.0) * weight
        assert balance == pytest.approx(one.force.flow[along], rel=1e-5)
    light, heavy = (one.force.flow[along] for one in found.values())
    added = (heavy - light) / (gained[0.3] - gained[2.65])
    expected = displaced * of_disc(0.5 * (4.0 / 600.0 * first) ** -0.5)
    print(added / expected, light + added * gained[0.3])
    assert (1.05 * expected < added).all() and (added < 1.25 * expected).all()
    load = held.force.flow[along]
    assert light + added * gained[0.3] == pytest.approx(load, abs=0.01 * np.linalg.norm(load))


def over_mean_profile(number):
    """Velocity along and spin of a disc let go one diameter above a bed, over those in laminar flow, less one."""
    mean = developed(60.0 * number).mean
    end = 0.5 * number**0.5
    sections = {
        "domain": Domain(length=24.0, height=60.0, origin=(-9.6, 0.0)),
        "bed": Flat(),
        "body": Disc(diameter=1.0, centre=(0.0, 1.5), motion="free", density=1.5),
        "gravity": Gravity(acceleration=0.0),
        "numerics": Numerics(order=2, error_bars=False, mesh_size=1.5),
        "output": Output(fields=False),
    }
    eddying = Scene(
        **sections,
        fluid=Fluid(reynolds=60.0 * number * mean, scale="flow"),
        flow=OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence={"model": "k-omega-sst"},
        time=Time(end=end * mean, step=0.05 * end * mean, start="steady"),
    )
    plain = Scene(
        **sections,
        fluid=Fluid(reynolds=number, scale="grain"),
        flow=LogLaw(shear_velocity=1.0),
        time=Time(end=end, step=0.05 * end, start="steady"),
    )
    found = [incipient.run(one).trajectory for one in (eddying, plain)]
    velocities = [np.array([*one["velocity"], one["spin"]]) for one in found]
    over = velocities[0] * mean / velocities[1] - 1.0
    print(number, over)
    return over[[0, 2]]


@pytest.mark.slow
def test_sand_let_go_goes_as_in_laminar_flow_over_the_mean_profile():
    """u* d/nu = 1 within 3%, nearer than at 10, as loads on held grains (test_resolved_channels.py), as deep a flow."""
    slow, fast = over_mean_profile(1.0), over_mean_profile(10.0)
    assert np.abs(slow).max() < 0.03
    assert (np.abs(slow) < np.abs(fast)).all()


def test_on_a_new_mesh_k_is_at_least_what_is_not_destroyed():
    """In clefts it falls without end, and ln k by e-folds from node to node, with which no time step was found."""
    scene = moving(0.1, 0.05, "rest", motion="fixed")
    finer = moving(0.1, 0.05, "rest", motion="fixed", mesh_size=2.0)
    with prepared(scene, MPI.COMM_SELF) as old, prepared(finer, MPI.COMM_SELF) as new:
        before, after = (run.part("turbulence") for run in (old, new))
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
