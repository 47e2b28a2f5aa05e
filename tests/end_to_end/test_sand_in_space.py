"""A small grain on a level bed in space by k-omega SST: how sure its loads are, slow streams, flow in time."""

import re
import textwrap
from pathlib import Path

import numpy as np
import pytest
from turbulent import column

import incipient
from incipient.accuracy.discretisation import by_coarser_mesh
from incipient.effects.turbulence import k_omega_flow
from incipient.effects.turbulence.pseudo_time import solve_together
from incipient.errors import ConvergenceError
from incipient.planning.flow_setup import Setup
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
    Time,
    Turbulence,
    load,
)
from incipient.scene.file import dumps

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
    laminar = incipient.run(sand(100.0, 1.0, effects=Effects(turbulence=False), turbulence=None))
    found = incipient.run(sand(100.0, 1.5))
    assert any("laminar by the k-omega model" in one for one in found.plan.warnings)
    assert found.force.flow == pytest.approx(laminar.force.flow, rel=0.01, abs=1e-6)
    assert found.couple.flow == pytest.approx(laminar.couple.flow, rel=0.01, abs=1e-6)


@pytest.mark.slow
def test_the_error_bar_of_the_mesh_holds_what_a_finer_one_finds():
    """u* d/nu = 22, on cells 1.4 times as large as those of a mesh that is compared with."""
    scene = sand(1500.0, 1.1 * 2**0.5)

    def loads(one):
        return incipient.run(one).loads_at_end()

    found, finer = loads(scene), loads(sand(1500.0, 1.1))
    term = by_coarser_mesh(scene, found, loads)
    assert (abs(found.force - finer.force) <= term.force).all()
    assert (abs(found.couple - finer.couple) <= term.couple).all()


@pytest.mark.slow
def test_an_accuracy_is_reached_and_a_finer_mesh_agrees():
    """u* d/nu = 22: the first three meshes give the first estimate; a run on cells of 0.78 is within it.

    No other program has been asked: the finer mesh is of this one (docs/k_omega_in_space.md, error bars in space).
    """
    numerics = Numerics(order=2, accuracy=0.12, accuracy_of="force", error_bars=False)
    found = incipient.run(sand(1500.0, 1.0).model_copy(update={"numerics": numerics}))
    assert found.adaptation is not None and found.adaptation.met
    assert [trial.note for trial in found.adaptation.trials][:3] == [
        f"mesh_size {size}" for size in ("3.2", "2.26", "1.6")
    ]
    finer, error = np.array([0.1780, 0.0, 0.0563]), found.adaptation.reached
    assert np.linalg.norm(found.force.flow - finer) < error * np.linalg.norm(finer) < 0.12 * 0.187


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

    found = incipient.threshold(cube(1500.0, 0.3))
    drag, across, lift = found.load.flow_force
    assert found.mode == "sliding" and len(found.trials) <= 8
    assert across == 0.0 and 0.0 < lift < drag
    assert drag == pytest.approx(0.5 * (1.65 * 0.3 - lift), rel=1e-3)
    there = incipient.run(cube(1500.0 * found.factor, 0.3 / found.factor**2))
    assert there.verdict["safety_factor"] == pytest.approx(1.0, abs=0.01)


def assert_stays(reynolds, step, end, **changes):
    """Force and couple of a steady flow are within 1e-4 what they are after it has gone on in time."""
    steady = incipient.run(sand(reynolds, 3.0, **changes))
    later = incipient.run(
        sand(reynolds, 3.0, time=Time(step=step, end=end, start="steady"), **changes)
    )
    assert later.force.flow == pytest.approx(steady.force.flow, rel=1e-4, abs=1e-9)
    assert later.couple.flow == pytest.approx(steady.couple.flow, rel=1e-4, abs=1e-9)


@pytest.mark.slow
def test_a_steady_flow_stays_in_time():
    """u* d/nu = 22: loads on the sphere after three steps, in each of which the flow passes half of it."""
    assert_stays(1500.0, 0.5, 1.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "body", [{"motion": "fixed"}, {"motion": "prescribed", "course": ("0",) * 6}]
)
def test_over_sand_a_steady_flow_stays_in_time(body):
    """u* k_s/nu = 4.4; a held sphere is in one system with its flow, one on a course of no way goes by turns."""
    rough = Turbulence(model="k-omega-sst", wall="rough", roughness=0.2)
    sphere = {"diameter": 1.0, "centre": (3.0, 3.0, 0.55)}
    steady = incipient.run(
        sand(1500.0, 3.0, turbulence=rough, body=Sphere(**sphere, motion="fixed"))
    )
    time = Time(step=0.5, end=1.5, start="steady")
    later = incipient.run(
        sand(1500.0, 3.0, turbulence=rough, body=Sphere(**sphere, **body), time=time)
    )
    assert later.force.flow == pytest.approx(steady.force.flow, rel=1e-4, abs=1e-9)
    assert later.couple.flow == pytest.approx(steady.couple.flow, rel=1e-4, abs=1e-9)


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


@pytest.mark.slow
def test_a_steady_flow_past_a_sphere_in_its_pocket_stays_in_time():
    """u* d/nu = 20, on a bed of equal spheres: loads after four steps, in each of which the flow passes a quarter."""
    assert_stays(300.0, 0.25, 1.0, **POCKET)


@pytest.mark.slow
def test_a_sphere_set_off_from_rest_in_its_pocket_gains_what_is_done_on_it():
    """Two steps of the demo; the first begins as one system with the flow. Kinetic energy is the sum of all works."""
    demo = Path(__file__).parents[2] / "demos/scenes/sand_leaving_pocket.toml"
    words = ["time.start=rest", "time.step=0.125", "time.end=0.25", "output.fields=false"]
    path = incipient.run(load(demo, words)).trajectory
    mass, velocity, spin = (
        2.65 * np.pi / 6.0,
        *(np.array(path[name]) for name in ("velocity", "spin")),
    )
    gained = 0.5 * mass * (velocity @ velocity + 0.1 * spin @ spin)
    assert gained == pytest.approx(sum(path["on_bed"]["works"].values()), rel=1e-6)
    assert gained > 0.01


HEIGHTS = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.4, 3.2, 4.0, 4.7)  # of measured rows


@pytest.mark.slow
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
    enters = Setup(developed).resolved_walls
    places = np.zeros((3, len(HEIGHTS)))
    places[2] = enters.floor + np.array(HEIGHTS)
    rows = [HEIGHTS, enters.velocity(places, 0.0)[0], np.exp(enters.logarithms(places)[0])]
    given |= {
        "inflow": "profile",
        "profile": np.transpose(rows).tolist(),
        "intensity": 1e-6,
        "length": 0.5,
    }
    found = incipient.run(sand(reynolds, 3.0, turbulence=Turbulence(**given), **bed))
    assert found.force.flow == pytest.approx(
        incipient.run(developed).force.flow, rel=0.02, abs=1e-9
    )


@pytest.mark.slow
def test_a_flow_set_off_past_a_sphere_in_its_pocket_becomes_the_steady_one():
    """60 diameters over the mean speed after the start, in steps of one."""
    steady = incipient.run(sand(300.0, 3.0, **POCKET))
    later = incipient.run(sand(300.0, 3.0, time=Time(step=1.0, end=60.0, start="rest"), **POCKET))
    assert later.force.flow == pytest.approx(steady.force.flow, rel=2e-4, abs=1e-9)
    assert later.couple.flow == pytest.approx(steady.couple.flow, rel=2e-4, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("settle", ["true", "false"])
def test_a_sphere_that_leaves_its_pocket_goes_about_the_two_in_front_of_it(settle, tmp_path):
    """u* d/nu = 20, a Shields number of 0.014: two steps of a quarter of d/V.

    It keeps its distance from both centres: its velocity is normal to the way to the point between them (geometry).
    Not settled it begins half its gap too near to these two, which the first step puts right; taken for what velocities
    do to the load that had led astray every step.
    """
    demo = Path(__file__).parents[2] / "demos/scenes/sand_leaving_pocket.toml"
    found = incipient.run(
        load(demo, ["time.end=0.5", "output.every=0", f"body.settle={settle}"]), tmp_path
    )
    assert column(tmp_path, "time").tolist() == [0.25, 0.5]
    (x, z), (u, w) = (
        [column(tmp_path, name) for name in names]
        for names in (("x", "z"), ("velocity_x", "velocity_z"))
    )
    # Measured where it settled: 0.0094 after the first step.
    assert (u > (0.009 if settle == "true" else 0.01)).all() and u[1] > 1.5 * u[0]
    assert w / u == pytest.approx((4.2887 - x) / z, rel=1e-3)
    assert found.trajectory["on_bed"]["mode"]


@pytest.mark.slow
def test_a_flow_not_found_from_a_slower_one_is_found_from_one_between(monkeypatch):
    """u* d/nu = 145 from 100: a first attempt that spoils both states and fails changes nothing of what is found."""
    expected, tried = incipient.run(sand(1.25e4, 3.0)), list[bool]()

    def failing_once(fluid, turbulence, tolerance, how, *more):
        tried.append(how.nearly)
        if len(tried) == 2:
            fluid.state.x.array[:] *= 3.0
            turbulence.state.x.array[:] = 0.0
            raise ConvergenceError("not this time")
        return solve_together(fluid, turbulence, tolerance, how, *more)

    monkeypatch.setattr(k_omega_flow, "solve_together", failing_once)
    found = incipient.run(sand(1.25e4, 3.0))
    assert tried == [True, False, True, False]
    assert found.force.flow == pytest.approx(expected.force.flow, rel=2e-3, abs=1e-9)
    assert found.couple.flow == pytest.approx(expected.couple.flow, rel=2e-3, abs=1e-9)


@pytest.mark.slow
def test_a_flow_set_off_from_rest_becomes_the_steady_one():
    """u* d/nu = 22, 60 diameters over the mean speed after the start."""
    steady = incipient.run(sand(1500.0, 3.0))
    later = incipient.run(sand(1500.0, 3.0, time=Time(step=1.0, end=60.0, start="rest")))
    assert later.force.flow == pytest.approx(steady.force.flow, rel=2e-4, abs=1e-9)
    assert later.couple.flow == pytest.approx(steady.couple.flow, rel=2e-4, abs=1e-9)


def set_off(end, **changes):
    """The sphere on coarse cells in the first moments after the stream is set off."""
    numerics = Numerics(mesh_size=4.4, order=2, error_bars=False, tolerance=1e-6)
    time, output = Time(step=0.25, end=end, start="rest"), Output(fields=False, checkpoint=2)
    return sand(1500.0, 4.4, time=time, output=output, numerics=numerics, **changes)


@pytest.mark.slow
def test_a_resumed_run_ends_where_the_whole_one_does(tmp_path):
    whole = incipient.run(set_off(1.0), tmp_path / "whole")
    incipient.run(set_off(0.5), tmp_path / "cut")
    resumed = incipient.resume(tmp_path / "cut", ["time.end=1.0"])
    assert resumed.force.flow == pytest.approx(whole.force.flow, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_over_an_inclined_bed_a_flow_set_off_is_that_over_a_level_one():
    """The slope turns gravity alone."""
    level, inclined = (
        incipient.run(set_off(0.25, bed=bed)) for bed in (Flat(), Inclined(slope=5.0))
    )
    assert inclined.force.flow == pytest.approx(level.force.flow, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_two_ranks_go_the_way_of_one(mpirun, tmp_path):
    """The mesh is parted another way in each run; so factors differ. Logarithms are solved to 1e-4, the flow to 1e-6.

    By turns the flow once took one application of factors for its solution, of which 0.9 of the residual was left where
    blocks were compressed: three runs of six found no step.
    """
    path = tmp_path / "scene.toml"
    path.write_text(dumps(set_off(0.75)), encoding="utf-8")
    script = """
        import incipient
        from mpi4py import MPI
        from incipient.scene.file import loads

        found = incipient.run(loads(open({path!r}).read()), {directory!r})
        if MPI.COMM_WORLD.rank == 0:
            print(found.force.flow.tolist(), found.couple.flow.tolist())
    """
    ends = []
    for ranks in (1, 2, 2):
        directory = tmp_path / str(len(ends))
        done = mpirun(
            ranks,
            textwrap.dedent(script).format(path=str(path), directory=str(directory)),
            timeout=600,
        )
        assert done.returncode == 0, done.stderr
        ends.append([float(one) for one in re.findall(r"[-+.e\d]+", done.stdout.splitlines()[-1])])
        assert column(directory, "time").tolist() == [0.25, 0.5, 0.75]
    one, *two = np.array(ends).reshape(3, 2, 3)
    for end in two:
        assert (np.linalg.norm(end - one, axis=1) <= 1e-5 * np.linalg.norm(one, axis=1)).all()
