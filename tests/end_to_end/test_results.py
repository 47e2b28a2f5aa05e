"""What a run leaves behind is complete, agrees with itself, and says again what was asked."""

import csv
import shutil
import subprocess
import sys

import numpy as np
import pytest
from environment import environment
from processes import CAVITY, GRAIN_ON_BED, VORTEX_STREET, result_of, settings

import incipient
from incipient.cli import main
from incipient.output.series_file import read_step
from incipient.sweep.worker import quantities

TOP_LEVEL = {
    *("schema_version", "title", "status", "error", "scene", "plan", "cost"),
    *("force", "torque", "coefficients", "contacts", "grain", "gap", "verdict", "centrelines"),
    *(
        "trajectory",
        "error_bars",
        "without_error_bars",
        "adaptation",
        "omitted",
        "measured_cell_reynolds",
    ),
    *("si", "surface", "turbulence", "steady", "separated"),
}
STAGES = {
    "plan",
    "import",
    "mesh",
    "forms",
    "flow",
    "tractions",
    "fields",
    "omitted effects",
    "total",
}
SOME_STAGES = {"contact", "error bars"}  # where there is a grain that rests, or any
OPTIONS = {
    "numerics_mesh_size": 2,
    "numerics_order": 2,  # which the quadratic cells of the files hold exactly
    "bed_kind": "half-discs",
    "bed_radius": 0.5,
    "bed_spacing": 1.2,
    "bed_offset": 1.0,
    "gravity_acceleration": 3.0,
    "numerics_error_bars": False,
}
# Gauss's points and weights on (-1, 1), and quadratic shape functions there: both ends, then the middle.
S, WEIGHTS = np.polynomial.legendre.leggauss(6)
SHAPES = np.array([S * (S - 1) / 2, S * (S + 1) / 2, 1 - S**2])
SLOPES = np.array([S - 0.5, S + 0.5, -2 * S])


def run_once(directory, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", "incipient", "run", *map(str, arguments), "--out", str(directory)],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return directory


def run_here(directory, *arguments):
    """In this process, which has loaded already what a run needs."""
    assert main(["run", *map(str, arguments), "--out", str(directory)]) == 0
    return directory


@pytest.fixture(scope="module")
def grain(tmp_path_factory):
    """A disc in the pocket of a bed of half-discs."""
    return run_once(tmp_path_factory.mktemp("grain"), GRAIN_ON_BED, *settings(**OPTIONS))


@pytest.fixture(scope="module")
def cavity(tmp_path_factory):
    return run_here(
        tmp_path_factory.mktemp("cavity"),
        CAVITY,
        *settings(numerics_mesh_size=3, fluid_reynolds=100),
    )


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """The first steps of a time-dependent run, fields at every third."""
    steps = settings(
        numerics_order=2, numerics_mesh_size=4, time_end=0.05, time_step=0.005, output_every=3
    )
    return run_here(tmp_path_factory.mktemp("street"), VORTEX_STREET, *steps)


# -- result.json ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["grain", "cavity", "street"])
def test_result_has_the_documented_keys(name, request):
    result = result_of(request.getfixturevalue(name))
    assert set(result) == TOP_LEVEL
    assert (
        result["schema_version"] == 2 and result["status"] == "complete" and result["error"] == ""
    )
    decision = {"name", "present", "reason", "forced", "expected", "of"}
    assert set(result["plan"]["effects"][0]) == decision
    assert {"order", "geometry_order", "mesh_size", "convection", "scheme", "reynolds"} <= set(
        result["plan"]
    )


def test_a_wide_gap_is_warned_of_wherever_the_run_is_told(tmp_path, capsys, caplog):
    scene = settings(
        numerics_mesh_size=6, numerics_error_bars=False, contact_gap=0.05, output_fields=False
    )
    warning = "contact.gap = 0.05 is wide"
    assert main(["run", str(GRAIN_ON_BED), *scene, "--out", str(tmp_path)]) == 0
    assert warning in capsys.readouterr().out and f"warning: {warning}" in caplog.text
    (told,) = result_of(tmp_path)["plan"]["warnings"]
    assert told.startswith(warning)


def test_the_plan_in_the_result_has_the_datum(grain, cavity):
    datum = result_of(grain)["plan"]["datum"]
    assert 0.4468 < datum["height"] < 0.5  # in creeping flow, and the crests
    assert datum["reason"].startswith(
        "the effective height of the bed, computed from its shape, of it 0.0013 by"
    )
    assert result_of(cavity)["plan"]["datum"] is None


def test_the_cost_is_told(grain, street):
    for directory in (grain, street):
        cost = result_of(directory)["cost"]
        assert set(cost["wall_time"]) - SOME_STAGES == STAGES
        stages = {name: seconds for name, seconds in cost["wall_time"].items() if name != "total"}
        assert 0 < sum(stages.values()) <= cost["wall_time"]["total"]
        assert all(cost[name] > 0 for name in ("unknowns", "cells", "peak_memory_mib", "ranks"))
        assert all(cost["iterations"][name] > 0 for name in ("newton", "factorisations"))
        assert cost["iterations"]["krylov"] >= 0  # none where the factors alone will do
        assert {"incipient", "dolfinx", "petsc", "python", "numpy"} <= set(cost["versions"])
    assert result_of(street)["cost"]["iterations"]["steps"] == 10


def test_forces_couples_and_contacts_fit_together(grain):
    result = result_of(grain)
    force, scene = result["force"], result["scene"]
    area, gravity = np.pi / 4, scene["gravity"]["acceleration"]
    assert force["buoyancy"] == pytest.approx([0, area * gravity, 0])
    assert force["weight"] == pytest.approx([0, -scene["body"]["density"] * area * gravity, 0])
    parts = [force[name] for name in ("flow", "buoyancy", "weight")]
    assert force["total"] == pytest.approx(np.sum(parts, axis=0))
    # The surface integral converges half as fast: it is a check, not the answer.
    assert force["surface_integral"] == pytest.approx(force["flow"], rel=0.02, abs=1e-12)
    assert result["torque"]["surface_integral"] == pytest.approx(result["torque"]["flow"], rel=0.05)
    unit = 0.5 * result["coefficients"]["reference_velocity"] ** 2
    assert result["coefficients"]["drag"] == pytest.approx(force["flow"][0] / unit)
    for load in (result["force"], result["torque"]):
        both = np.add(load["pressure"], load["viscous"])
        assert both == pytest.approx(load["surface_integral"], rel=1e-12, abs=1e-15)
    # Pressure acts through the centre of a disc.
    assert abs(result["torque"]["pressure"][2]) < 1e-5 * abs(result["torque"]["flow"][2])
    columns = quantities("run", result)
    assert columns["pressure_force_x"] == result["force"]["pressure"][0]
    assert result["coefficients"]["moment"] == pytest.approx(result["torque"]["flow"][2] / unit)
    assert len(result["contacts"]) == 2
    for contact in result["contacts"]:
        # Both discs have the same radius: the contact lies where their surfaces meet, on the line of centres.
        arm = np.subtract(contact["point"][:2], result["grain"]["centre"])
        assert arm == pytest.approx(0.5 * np.array(contact["normal"][:2]))
    assert result["gap"]["width"] == pytest.approx(0.01) and result["gap"]["resolved"]
    assert isinstance(result["verdict"]["moves"], bool) and result["verdict"]["sentence"]


def test_a_cavity_has_centrelines_and_no_grain(cavity):
    result = result_of(cavity)
    assert set(result["centrelines"]) == {"minimum of v1", "maximum of v2", "minimum of v2"}
    for name in ("force", "torque", "coefficients", "grain", "gap", "verdict"):
        assert result[name] is None
    assert result["contacts"] == []
    assert not (cavity / "surface.xdmf").exists() and not (cavity / "history.csv").exists()


# -- scene.toml ----------------------------------------------------------------------------------------------


def test_the_written_scene_is_the_scene_that_ran(grain):
    asked = [option for option in settings(**OPTIONS) if option != "--set"]
    assert incipient.load(grain / "scene.toml") == incipient.load(GRAIN_ON_BED, asked)


def test_the_written_scene_gives_the_same_numbers(grain, tmp_path):
    shutil.copy(grain / "scene.toml", tmp_path / "again.toml")
    incipient.run(incipient.load(tmp_path / "again.toml"), tmp_path / "x")
    again = result_of(tmp_path / "x")
    first = result_of(grain)
    for name in ("force", "torque", "coefficients", "grain", "gap", "contacts", "verdict", "scene"):
        assert again[name] == first[name]


def test_the_written_scene_does_not_need_the_bed_s_file(tmp_path):
    (tmp_path / "bed.csv").write_text("x,y\n0,0\n15,0\n15.5,0.2\n16,0\n24,0\n")
    text = GRAIN_ON_BED.read_text().replace('"flat"', '"polyline"\nfile = "bed.csv"')
    (tmp_path / "scene.toml").write_text(text)
    coarse = ["numerics.mesh_size=6", "numerics.error_bars=false"]
    incipient.run(incipient.load(tmp_path / "scene.toml", coarse), tmp_path / "x")
    shutil.move(tmp_path / "bed.csv", tmp_path / "gone.csv")
    (tmp_path / "elsewhere").mkdir()
    moved = shutil.copy(tmp_path / "x/scene.toml", tmp_path / "elsewhere")
    incipient.run(incipient.load(moved), tmp_path / "y")
    # The same scene to the last bit; processes of their own may add in another order (numpy's choice of instructions).
    x, y = (incipient.load(tmp_path / name / "scene.toml") for name in "xy")
    assert x == y
    of_x, of_y = (result_of(tmp_path / name)["force"]["flow"] for name in "xy")
    assert of_y == pytest.approx(of_x, rel=1e-12, abs=1e-12 * max(map(abs, of_x)))


# -- fields --------------------------------------------------------------------------------------------------


def opened(stem):
    """What VTK, and with it ParaView, reads: a grid for each time."""
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(str(stem.with_suffix(".xdmf")))
    found = {}
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grid = reader.read()
        found[time] = grid[0] if isinstance(grid, pyvista.MultiBlock) else grid
    return found


def steady(stem):
    """What VTK, and with it ParaView, reads of a flow without time."""
    ((_, grid),) = opened(stem).items()
    return grid


def test_vtk_opens_the_fields(grain):
    grid = steady(grain / "fields")
    assert set(grid.point_data) == {"velocity", "pressure", "vorticity"}
    assert grid.n_cells == result_of(grain)["cost"]["cells"]
    assert grid.bounds[:4] == pytest.approx((0, 24, 0, 20), abs=1e-9)
    assert grid["velocity"].shape[1] == 3
    inflow = np.abs(grid.points[:, 0]) < 1e-9
    # The profile starts from the datum, below the half-disc there, whose centre is 0.2 away.
    y, datum = grid.points[inflow, 1], result_of(grain)["plan"]["datum"]["height"]
    profile = np.minimum(y - datum, 3 * (y - np.sqrt(0.5**2 - 0.2**2)))
    assert grid["velocity"][inflow, 0] == pytest.approx(np.clip(profile, 0, None), abs=1e-9)
    centre = np.array(result_of(grain)["grain"]["computed_centre"])
    on_grain = np.isclose(np.linalg.norm(grid.points[:, :2] - centre, axis=1), 0.5, atol=1e-6)
    assert on_grain.sum() > 20 and np.abs(grid["velocity"][on_grain]).max() < 1e-12


def test_vorticity_is_that_of_the_velocity(cavity):
    """Stokes's theorem: over the box the vorticity adds up to the circulation, which is minus the lid's speed."""
    step = read_step(cavity / "fields")
    corners = step.points[step.cells[:, :3], :2]
    area = 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    middles = step.fields["vorticity"][step.cells[:, 3:]].mean(axis=1)  # exact for quadratics
    assert area.sum() == pytest.approx(1.0)
    assert area @ middles == pytest.approx(-1.0, rel=0.05)


def test_the_traction_on_the_surface_adds_up_to_the_force(grain):
    grid = steady(grain / "surface")
    assert set(grid.point_data) == {"traction"}
    step, result = read_step(grain / "surface"), result_of(grain)
    nodes, traction = step.points[step.cells], step.fields["traction"][step.cells]
    stretch = np.linalg.norm(np.einsum("cni,ng->cgi", nodes, SLOPES), axis=2) * WEIGHTS
    there = np.einsum("cni,ng->cgi", traction, SHAPES)
    force = np.einsum("cgi,cg->i", there, stretch)
    assert stretch.sum() == pytest.approx(np.pi, rel=1e-4)
    assert force == pytest.approx(result["force"]["flow"], rel=1e-5, abs=1e-12)
    arms = np.einsum("cni,ng->cgi", nodes, SHAPES) - result["torque"]["about"]
    couple = np.einsum("cgi,cg->i", np.cross(arms, there), stretch)
    assert couple == pytest.approx(result["torque"]["flow"], rel=1e-5, abs=1e-12)


# -- time ----------------------------------------------------------------------------------------------------


def test_history_has_a_row_for_every_step(street):
    with (street / "history.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    expected = {
        "time",
        "step",
        "newton",
        "error",
        "force_x",
        "force_y",
        "torque",
        "drag",
        "lift",
        "moment",
        "mode",
    }
    assert set(rows[0]) == expected
    assert [float(row["time"]) for row in rows] == pytest.approx(0.005 * np.arange(1, 11))
    result = result_of(street)
    last = [
        float(rows[-1][name]) for name in ("force_x", "force_y", "torque", "drag", "lift", "moment")
    ]
    coefficients = [result["coefficients"][name] for name in ("drag", "lift", "moment")]
    assert last == [*result["force"]["flow"][:2], result["torque"]["flow"][2], *coefficients]


def test_fields_are_written_when_asked_and_at_the_end(street):
    assert list(opened(street / "fields")) == pytest.approx([0.015, 0.03, 0.045, 0.05])
    assert list(opened(street / "surface")) == pytest.approx([0.015, 0.03, 0.045, 0.05])


# -- from Python ---------------------------------------------------------------------------------------------


def test_python_gives_what_the_command_gives(grain, tmp_path):
    asked = [option for option in settings(**OPTIONS) if option != "--set"]
    result = incipient.run(incipient.load(GRAIN_ON_BED, asked), tmp_path)
    told, here = result_of(grain), result_of(tmp_path)
    assert result.force.flow == pytest.approx(told["force"]["flow"], rel=1e-12)
    assert result.verdict["moves"] == told["verdict"]["moves"]
    for name in ("force", "torque", "coefficients", "verdict"):
        assert here[name] == told[name]
    assert result.velocity.function_space.mesh.comm.size == 1
    nothing_written = incipient.run(incipient.load(GRAIN_ON_BED, asked))
    assert nothing_written.force.flow == pytest.approx(result.force.flow, rel=1e-12)


def test_nothing_is_imported_that_the_scene_does_not_call_for(tmp_path):
    code = "import sys; from incipient.cli import main; assert main(sys.argv[1:]) == 0; print(*sys.modules)"
    small = settings(numerics_order=2, numerics_mesh_size=4, output_fields=False)
    done = subprocess.run(
        [sys.executable, "-c", code, "run", str(CAVITY), *small],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    needed = {"incipient.simulation.simulate", "incipient.fluid.steady", "incipient.meshes.model"}
    unused = (
        "contact",
        "coupled.tractions",
        "evaluation.contact_verdict",
        "output.xdmf",
        "pictures",
    )
    assert needed <= loaded
    assert not {f"incipient.{name}" for name in unused} & loaded
    assert not {"pyvista", "matplotlib", "vtk", "rich", "pkg_resources"} & loaded
    # Symbols of what is loaded later are looked up in all of dolfinx's libraries.
    order = done.stdout.split()
    assert order.index("gmsh") < order.index("dolfinx")
