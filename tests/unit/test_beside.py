"""Coarse runs of error bars in space on the mesh of the run, moved: to another gap, into a larger domain."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import sphere_on_plane

from incipient.accuracy.coarse_runs import coarse
from incipient.accuracy.errorbars import coarse_scenes
from incipient.errors import ConvergenceError
from incipient.mesh.motion import MeshMotion, Potentials, stretched
from incipient.meshes import SYMMETRY
from incipient.results.errorbars import Loads
from incipient.scene import Contact, Domain, Fluid, Gravity, Numerics, Scene, Sphere, SphereBed
from incipient.simulation.beside import Beside, InTurn
from incipient.simulation.build import prepared
from incipient.simulation.steady import solve_steadily

# Force over 6 pi mu a G h and torque over 4 pi mu a^3 G with gaps of 1.25% and 5% of the diameter (Goldman, Cox &
# Brenner 1967, Chem. Eng. Sci. 22, 653, in bispherical coordinates; the table of docs/validation/laminar.md).
AT_FIVE_PERCENT = 1.6325, 0.9518


def on_plane(**changes: Any) -> Scene:
    given: dict[str, Any] = {
        "domain": Domain(length=40.0, width=40.0, height=20.0),
        "fluid": Fluid(reynolds=1.0, scale="grain", inertia=False),
        "body": Sphere(diameter=1.0, x=20.0, density=2.65),
        "gravity": Gravity(acceleration=50.0),
        "contact": Contact(friction=0.5, gap=0.0125),
        "numerics": Numerics(order=2, mesh_size=1.6),
    }
    return sphere_on_plane(**{**given, **changes})


def never(scene: Scene, comm: MPI.Comm, speed: float) -> Loads:
    raise AssertionError("the mesh of the run serves")


@pytest.mark.slow
def test_the_mesh_of_a_run_serves_for_other_gaps_and_domains() -> None:
    """With four times the gap the exact loads, to the error of such cells (1.1%, docs/contribute/defaults.md)."""
    scene = on_plane()
    one, two, four, farther, farthest = coarse_scenes(scene)
    with prepared(scene, MPI.COMM_SELF) as run:
        solve_steadily(run, run.fluid)
        before, own = run.domain.mesh.geometry.x.copy(), run.probe.resultant()
        found = [
            Beside(run, coarse_scenes, never)(each) for each in (one, two, four, farther, farthest)
        ]
        assert np.array_equal(run.domain.mesh.geometry.x, before)
        faster = Beside(run, coarse_scenes, never, speed=3.0)(one)
        assert np.array_equal(run.probe.resultant().force, own.force)
    assert found[0].force == pytest.approx(own.force) and found[0].torque == pytest.approx(
        own.torque
    )
    assert faster.force == pytest.approx(3.0 * own.force)  # creeping: in proportion to the speed
    units = 6 * pi * scene.viscosity * 0.5 * 0.55, 4 * pi * scene.viscosity * 0.125
    assert found[2].force[0] / units[0] == pytest.approx(AT_FIVE_PERCENT[0], rel=0.015)
    assert found[2].torque[1] / units[1] == pytest.approx(AT_FIVE_PERCENT[1], rel=0.015)
    assert (
        own.force[0] < found[1].force[0] < found[2].force[0]
    )  # the shear is faster where the centre is higher
    # Sides closer to the sphere hold the fluid back: the force falls as they go, by less than a percent there.
    assert 0.99 * own.force[0] < found[3].force[0] < own.force[0]
    assert 0.99 * own.force[0] < found[4].force[0] < own.force[0]


def test_half_a_sphere_is_lifted_with_the_plane_of_symmetry() -> None:
    """Cells above and below it, some of them small, keep their shape: no nodes stay behind on the plane.

    Lifted by a gap l cells that fill the gap become l/gap as high, which leaves 3 l^(2/3)/(2 + l^2) of their quality.
    """
    scene = on_plane(
        domain=Domain(length=6.0, width=6.0, height=3.0, symmetric=True),
        body=Sphere(diameter=1.0, x=3.0, density=2.65),
        numerics=Numerics(order=2, mesh_size=0.5),
    )
    with prepared(scene, MPI.COMM_SELF) as run:
        places, motion = run.domain.mesh.geometry.x, MeshMotion(run.domain)
        weights = Potentials(run.domain).weights("body", (SYMMETRY,), rigid=1.0)[:, None]
        lifted = places + weights * [0.0, 0.0, 3.0 * scene.contact_gap]
        assert motion.quality(lifted).relative > 0.5 * (3.0 * 4.0 ** (2 / 3) / (2.0 + 4.0**2))


@pytest.mark.slow
def test_far_sides_are_found_with_inertia() -> None:
    """At G d^2/nu = 200 Newton's method begins with the base flow of the larger domain, 1.5 and 2.25 times as far.

    From the old values at the new places its linear systems were not solved in 400 iterations. Sides so far away
    change the drag by less than a percent (the run on a mesh of its own: 0.2%).
    """
    scene = on_plane(
        domain=Domain(length=40.0, width=20.0, height=12.0, symmetric=True),
        fluid=Fluid(reynolds=200.0, scale="grain"),
        body=Sphere(diameter=1.0, x=15.0, density=2.65),
        numerics=Numerics(order=2),
    )
    *_, farther, farthest = coarse_scenes(scene)
    with prepared(scene, MPI.COMM_SELF) as run:
        solve_steadily(run, run.fluid)
        own = run.probe.resultant().force[0]
        drags = [Beside(run, coarse_scenes, never)(each).force[0] for each in (farther, farthest)]
    assert drags == pytest.approx([own, own], rel=0.01) and len({own, *drags}) == 3


def test_a_bed_with_forms_up_to_the_sides_is_meshed_anew() -> None:
    """Its spheres would be stretched with the domain; then no scene is computed on the mesh of the run."""
    scene = on_plane(
        domain=Domain(length=4.0, width=4.0, height=3.0),
        body=Sphere(diameter=1.0, x=2.0, density=2.65),
        bed=SphereBed(radius=1.0, spacing=2.2, offset=(1.0, 2.0)),
        contact=Contact(friction=0.5, gap=0.025),
        numerics=Numerics(order=2, mesh_size=6.0),
    )
    asked = []

    def noted(scene: Scene, comm: MPI.Comm, speed: float) -> Loads:
        asked.append(speed)
        return Loads(np.zeros(3), np.zeros(3))

    with prepared(scene, MPI.COMM_SELF) as run:
        beside = Beside(run, coarse_scenes, noted, speed=2.0)
        for each in coarse_scenes(scene):
            beside(each)
    assert asked == [2.0] * 5


def test_a_mesh_around_a_free_sphere_serves_for_larger_domains() -> None:
    """Without a bed the domain grows downwards, too, and where the profile of the flow starts says nothing."""
    scene = Scene(
        domain=Domain(length=24.0, width=16.0, height=16.0),
        fluid=Fluid(reynolds=1.0, scale="grain"),
        flow={"kind": "uniform"},
        body=Sphere(diameter=1.0, centre=(8.0, 8.0, 8.0)),
        numerics=Numerics(order=2, mesh_size=4.0),
    )
    here, *larger = coarse_scenes(scene)
    with prepared(scene, MPI.COMM_SELF) as run:
        beside = Beside(run, coarse_scenes, never)
        assert all(beside.serves(each.model_dump_json()) for each in (here, *larger))
    assert len(larger) == 2 and larger[1].domain.bottom < larger[0].domain.bottom < 0.0


@pytest.mark.slow
def test_coarse_runs_in_turn_on_meshes_of_their_own_are_made_once() -> None:
    """Where no mesh serves for all the run of each scene gives its loads; none is run a second time."""
    scene = on_plane(
        domain=Domain(length=4.0, width=4.0, height=3.0),
        body=Sphere(diameter=1.0, x=2.0, density=2.65),
        bed=SphereBed(radius=1.0, spacing=2.2, offset=(1.0, 2.0)),
        contact=Contact(friction=0.5, gap=0.025),
        numerics=Numerics(order=2, mesh_size=6.0),
    )
    with InTurn(MPI.COMM_SELF, coarse_scenes, never) as solve:
        found = [solve(each) for each in coarse_scenes(scene)[:2]]
    assert not any(one.moved for one in found) and 0.0 < found[0].force[0] < found[1].force[0]


@pytest.mark.slow
def test_a_run_that_fails_is_not_handed_over_nor_used_again() -> None:
    """One Newton update does not solve a flow at G d^2/nu = 40; the run before it has been freed by then."""
    scene = on_plane(
        domain=Domain(length=3.0, width=3.0, height=2.0),
        fluid=Fluid(reynolds=40.0, scale="grain"),
        body=Sphere(diameter=1.0, x=1.5, density=2.65),
        numerics=Numerics(order=2, mesh_size=9.0, stabilisation="off"),
    )
    few = scene.numerics.model_copy(update={"max_iterations": 1, "tolerance": 1e-12})
    failing = scene.model_copy(update={"numerics": few, "title": "fails"})
    with InTurn(MPI.COMM_SELF, coarse_scenes, never) as solve:
        first = solve(scene)
        with pytest.raises(ConvergenceError):
            solve(failing)
        assert solve.handed_over(failing) is None
        again = solve(scene)
        assert again.force == pytest.approx(first.force, rel=1e-6)
        handed = solve.handed_over(scene)
    assert handed is not None
    with handed[1]:
        assert handed[0].scene == scene


# The first rank is elsewhere when the second meets a defect; freeing MUMPS's factors is collective.
DEFECT = """
import time
from mpi4py import MPI
from incipient.fluid.projection import Projection
from incipient.scene import Domain, Fluid, Numerics, Sphere
from incipient.accuracy.errorbars import coarse_scenes
from incipient.simulation.beside import InTurn
from scenes import sphere_on_plane

comm = MPI.COMM_WORLD
small = Domain(length=3.0, width=3.0, height=2.0)
sphere = Sphere(diameter=1.0, x=1.5)
direct = Numerics(order=2, mesh_size=9.0, stabilisation="off")
fluid = Fluid(reynolds=400.0, scale="grain")
scene = sphere_on_plane(domain=small, fluid=fluid, body=sphere, numerics=direct)
try:
    with InTurn(comm, coarse_scenes, None) as solve:
        solve(scene)
        with Projection(solve._run.fluid) as projection:
            projection.apply()
            if comm.rank == 0:
                time.sleep(50)
            raise ValueError("a defect of this rank")
except ValueError as error:
    print(f"{comm.rank}: {error}", flush=True)
    comm.Abort(3)
"""


@pytest.mark.slow
def test_a_defect_of_one_rank_does_not_wait_for_the_others(mpirun: Any) -> None:
    """It leaves the contexts of coarse runs and of a projection at once, as its traceback has to be shown."""
    done = mpirun(2, DEFECT, timeout=40)
    assert done.returncode == 3, done.stderr
    assert done.stdout.split("\n")[0] == "1: a defect of this rank"


def test_points_are_stretched_away_from_the_middle_only() -> None:
    """A side goes to its new place, what is near the centre stays, and no two points change their order."""
    old = np.array([[0.0, 0.0, 0.0], [10.0, 8.0, 6.0]])
    new = np.array([[-2.0, 0.0, 0.0], [15.0, 12.0, 6.0]])
    centre, kept = np.array([5.0, 4.0, 1.0]), np.array([2.0, 1.0, 1.0])
    line = np.linspace(0.0, 1.0, 101)[:, None] * old[1]
    moved = stretched(line, centre, kept, old, new)
    assert moved is not None and np.all(np.diff(moved[:, :2], axis=0) > 0.0)
    assert moved[0] == pytest.approx([-2.0, 0.0, 0.0]) and moved[-1] == pytest.approx(
        [15.0, 12.0, 6.0]
    )
    near = np.abs(line - centre) <= kept
    assert np.array_equal(moved[near], line[near]) and np.array_equal(moved[:, 2], line[:, 2])
    assert stretched(line, centre, np.full(3, 9.0), old, new) is None
    assert stretched(line, centre, kept, new, np.array([old[0], [8.0, 8.0, 6.0]])) is None


@pytest.mark.slow
def test_coarse_runs_in_turn_have_the_mesh_of_the_first() -> None:
    """Without a run beside them: the first is run, its mesh serves the others; another scene begins anew."""
    scenes = coarse_scenes(coarse(on_plane()))
    with InTurn(MPI.COMM_SELF, coarse_scenes, never) as solve:
        found = [solve(each) for each in scenes[:2]]
        other = solve(coarse(on_plane(domain=Domain(length=60.0, width=60.0, height=30.0))))
    assert all(one.moved for one in (*found, other))
    with prepared(scenes[0], MPI.COMM_SELF) as run:
        solve_steadily(run, run.fluid)
        beside = [Beside(run, coarse_scenes, never)(each) for each in scenes[:2]]
    for one, another in zip(found, beside, strict=True):
        assert one.force == pytest.approx(another.force, rel=1e-4)
