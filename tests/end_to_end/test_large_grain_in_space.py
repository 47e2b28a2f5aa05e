"""A large grain on the bed of a turbulent stream in space: its loads, and where they come from."""

import textwrap

import numpy as np
import pytest
from mpi4py import MPI
from turbulent import balance, stream

import incipient
from incipient.scene import (
    Box,
    Contact,
    Cylinder,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    Numerics,
    OpenChannel,
    Output,
    RidgeBed,
    Scene,
    Sphere,
    SphereBed,
    Turbulence,
)
from incipient.scene.file import dumps
from incipient.setup.setup import Setup
from incipient.simulation.assemble import outcome
from incipient.simulation.build import prepared
from incipient.thresholds.critical import NOT_ONE


def stone(mesh_size=7.0, **changes):
    """A sphere of 0.4 of the depth on a level bed, u* d/nu about 3200; mean velocity and depth are 1."""
    sections = {
        "domain": Domain(length=1.6, width=1.2, height=1.0),
        "fluid": Fluid(reynolds=2e5, scale="flow"),
        "flow": OpenChannel(),
        "body": Sphere(diameter=0.4, x=0.6, density=2.65),
        "bed": Flat(),
        "gravity": Gravity(acceleration=10.0),
        "contact": Contact(friction=0.6, gap=0.03),
        "effects": Effects(turbulence=True),
        "numerics": Numerics(mesh_size=mesh_size, error_bars=False),
        "output": Output(fields=False),
    }
    return Scene(**{**sections, **changes})


@pytest.mark.slow
def test_what_grain_and_walls_bear_is_what_the_stream_loses():
    """Balance of momentum along half of the channel, with the eddies of the steady flow: to the tolerance of the flow.

    Force and torque are those of the whole grain; across the stream they vanish.
    """
    with prepared(stone(), MPI.COMM_SELF) as run:
        assert run.fluid.solver.regular, "on few cells factors are faster than blocks"
        run.turbulence.solve(run)
        assert run.fluid.solve(1e-7).converged
        borne, lost = balance(run.fluid, ("body", "bed"))
        force, result = run.probe.resultant(), outcome(run)
    assert sum(borne) == pytest.approx(lost, rel=1e-5)
    assert force.force[0] == pytest.approx(2.0 * borne[0], rel=1e-10)
    assert force.force[1] == force.torque[0] == force.torque[2] == 0.0
    assert result.verdict["moves"]


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="not converged on cells of 2; on cells of 1.4 drag differs by 4%, lift by 15%; both depend on the mesh",
)
def test_a_cylinder_across_the_stream_is_the_plane_s_disc():
    """Load per width, by the computation in the plane on cells as large."""
    disc = Disc(centre=(1.6, 0.3), diameter=0.3)
    cylinder = Cylinder(centre=(1.6, 0.1, 0.3), diameter=0.3, length=0.2)
    plane, space = (
        incipient.run(stream(2e5, domain, 2.0, "k-epsilon", bed=Flat(), body=body))
        for domain, body in (
            (Domain(length=4.0, height=1.0), disc),
            (Domain(length=4.0, width=0.2, height=1.0), cylinder),
        )
    )
    assert space.force.flow[0] / 0.2 == pytest.approx(plane.force.flow[0], rel=0.03)
    # Both lifts are 0.020 to the two digits that they were measured with: 5% at most in each.
    assert space.force.flow[2] / 0.2 == pytest.approx(plane.force.flow[1], rel=0.1)
    assert space.turbulence.at_outflow == pytest.approx(plane.turbulence.at_outflow, rel=0.01)


@pytest.mark.slow
def test_error_bars_of_a_sphere():
    """Mesh, gap and domain are estimated; the model's error is said to be in none of them."""
    bars = incipient.run(stone(numerics=Numerics(mesh_size=5.0))).error_bars
    assert [term.name for term in bars.terms] == ["discretisation", "gap", "domain"]
    assert all((term.force[[0, 2]] > 0.0).all() and term.force[1] == 0.0 for term in bars.terms)
    assert "turbulence model" in bars.left_out and not bars.failed


@pytest.mark.slow
def test_the_threshold_of_a_sphere_between_ridges():
    """In units of the critical flow its Reynolds number is larger and the sphere is lighter.

    That flow by a run of its own has the safety factor that the threshold tells of a mesh of its own, as it is the same
    mesh: cells are so few that meshes alike differ by a tenth in it. On the one mesh of the scene's flow, which was all
    there was, it was 1.13 and nothing was said.
    """

    def between(reynolds=2e5, acceleration=1.5):
        return stone(
            fluid=Fluid(reynolds=reynolds, scale="flow"),
            body=Sphere(diameter=0.4, x=0.875, density=2.65),
            bed=RidgeBed(amplitude=0.04, wavelength=0.5),
            gravity=Gravity(acceleration=acceleration),
        )

    computed = incipient.threshold(between())
    assert computed.is_critical
    there = incipient.run(between(2e5 * computed.factor, 1.5 / computed.factor**2))
    told = [
        note
        for note in computed.notes
        if note.startswith("WARNING: on a mesh made for the critical flow itself")
    ]
    safety = there.verdict["safety_factor"]
    assert len(told) == (abs(safety - 1.0) > NOT_ONE)
    assert all(f"the safety factor is {safety:.3g}, not 1" in note for note in told)


@pytest.mark.slow
def test_the_turbulent_flow_around_a_box_on_the_bed_is_found():
    """Sharp edges, on cells six times the default size: a box of a quarter of the depth.

    By 0.94 V, the speed at the height of its top, drag is 0.98: a cube in a uniform stream has 1.05 (Hoerner 1965,
    Fluid-Dynamic Drag, chapter 3), and here the profile slows towards the bed. u* is that of the flat bed by the law.
    """
    result = incipient.run(
        stone(
            6.0,
            domain=Domain(length=5.0, width=1.2, height=1.0),
            body=Box(sides=(0.25, 0.25, 0.2), x=2.5, density=2.65),
            contact=Contact(friction=0.6),
        )
    )
    drag, across, lift = result.force.flow
    coefficient = drag / (0.5 * 0.94**2 * 0.25 * 0.2)
    assert 0.8 < coefficient < 1.05
    assert across == pytest.approx(0.0, abs=1e-9 * drag)
    assert 0.0 < lift < drag
    assert result.turbulence.shear_velocity == pytest.approx(0.0405, rel=0.05)


def to_the_wall(mesh_size, domain, x):
    """A sphere on a level bed, u* d/nu = 86, by k-omega SST."""
    return stone(
        mesh_size,
        domain=domain,
        fluid=Fluid(reynolds=7500.0, scale="flow"),
        body=Sphere(diameter=1.0, x=x, density=2.65),
        contact=Contact(friction=0.5, gap=0.05),
        turbulence=Turbulence(model="k-omega-sst"),
        numerics=Numerics(mesh_size=mesh_size, order=2, error_bars=False),
    )


@pytest.mark.slow
def test_a_sphere_to_whose_wall_the_mesh_reaches():
    """k-omega SST, u* d/nu = 86 on a level bed; its wake leaves through the outflow, five diameters behind it.

    There u* in the mean across is 0.0527, below that of finite volumes in one dimension, but not by a tenth.
    By the speed at the centre the drag coefficient lies between 0.50 of k-epsilon with wall functions at 3200 and
    0.76, the mean of spheres above a smooth bed (Schmeeckle, Nelson & Shreve 2007, J. Geophys. Res. 112, F02003).
    """
    scene = to_the_wall(1.5, Domain(length=8.0, width=6.0, height=5.0), 3.0)
    result, walls = incipient.run(scene), Setup(scene).walls
    speed = walls.inflow.velocity_at(np.array([0.55]))[0, 0]
    assert not result.turbulence.plane
    assert 0.9 < result.turbulence.at_outflow / walls.shear_velocity < 1.0
    drag, across, lift = result.force.flow
    assert across == 0.0 and 0.0 < lift < drag
    assert 0.50 < drag / (0.5 * speed**2 * np.pi / 4.0) < 0.76
    assert result.verdict is not None


@pytest.mark.slow
def test_a_bead_leaves_its_pocket_at_the_measured_speed():
    """A bead of 8 mm and 2500 kg/m^3 on spheres as large, by k-omega SST at u* d/nu = 75, loads as the speed's square.

    Measured is 0.238 m/s on average once it moves, with fluctuations of 0.043 (Wu & Shih 2012, J. Geophys. Res. 117,
    F03006), where is not told: here the speed is that of the stream which enters at the height of its centre.
    It pivots between two spheres ahead.
    """
    speed = 1300.0 * 1e-6 / 0.008
    scene = stone(
        domain=Domain(length=9.0, width=5.0, height=5.866),
        fluid=Fluid(reynolds=1300.0, scale="grain"),
        body=Sphere(diameter=1.0, x=4.0, density=2.5),
        bed=SphereBed(
            radius=0.5,
            spacing=1.0,
            arrangement="triangular",
            angle=90.0,
            offset=(4.0 + 12.0**-0.5, 3.0),
        ),
        gravity=Gravity(acceleration=9.81 * 0.008 / speed**2),
        contact=Contact(friction=0.5, gap=0.05),
        turbulence=Turbulence(model="k-omega-sst"),
        numerics=Numerics(mesh_size=2.2, order=2, error_bars=False),
    )
    result, walls = incipient.run(scene), Setup(scene).walls
    height = scene.placement.centre[2] - walls.datum
    at_centre = speed * walls.inflow.velocity_at(np.array([height]))[0, 0]
    assert at_centre * result.verdict["safety_factor"] ** 0.5 == pytest.approx(0.238, abs=0.043)
    drag, across, lift = result.force.flow
    assert across == 0.0 and 0.0 < lift < drag


@pytest.mark.slow
def test_flow_and_turbulence_are_corrected_alike_on_two_ranks(mpirun, tmp_path):
    """The first step of pseudo-time past a sphere by k-omega SST: sizes of both corrections, and u* along the bed."""
    script = """
        from mpi4py import MPI
        from incipient import compat
        from incipient.turbulence.coupled_flow import CoupledFlow
        from incipient.scene.file import loads
        from incipient.simulation.build import prepared

        with prepared(loads(open({path!r}).read()), MPI.COMM_WORLD) as run:
            part, fluid = run.turbulence, run.fluid
            part.enter(fluid)
            fluid.constraints.update(0.0)
            compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
            part.fields.impose()
            with CoupledFlow(fluid, part.fields) as system:
                changes = []
                for courant in (2.0, 0.5):
                    system.courant[:] = courant
                    changes += [change.copy() for change in system.correction(True, 1e-8)]
                sizes = [MPI.COMM_WORLD.allreduce(float(change @ change)) for change in changes]
            walls = part.wall_report()
            if MPI.COMM_WORLD.rank == 0:
                print(*map(repr, [*sizes, walls.shear_velocity, walls.coarse_along]))
    """
    scene = to_the_wall(4.0, Domain(length=5.0, width=3.0, height=5.0), 2.0)
    (tmp_path / "scene.toml").write_text(dumps(scene), encoding="utf-8")
    script = textwrap.dedent(script).format(path=str(tmp_path / "scene.toml"))
    computed = [[float(word) for word in mpirun(n, script).stdout.split()] for n in (1, 2)]
    assert computed[1] == pytest.approx(computed[0], rel=1e-5)
    assert computed[0][:2] != pytest.approx(computed[0][2:4], rel=0.02)
