"""Fields written on one and two ranks (by xdmf_writer.py), read back with VTK's Xdmf2 reader.

ParaView's own readers, three of them, read the same files where pvpython is installed.

Expected values are the polynomials written; mid-side nodes are recomputed from their definition.
"""

import json
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from environment import environment, finished, on_ranks
from xdmf_writer import CELLS, RADIUS, SEMI_AXES, STEPS_A_MESH, placement, pressure, velocity

from incipient.output.series_file import read_step, times

WRITER = Path(__file__).with_name("xdmf_writer.py")
MAKE = {1: [sys.executable], 2: [*on_ranks(2), sys.executable]}
QUADRATIC_EDGE, QUADRATIC_TRIANGLE, QUADRATIC_TETRAHEDRON = 21, 22, 24  # vtkCellType.h


TASKS = (
    "write_all",
    "write_moving",
    "write_and_resume",
    "write_until_full",
    "write_where_impossible",
)


def spawn(ranks: int, directory: Path, *tasks: str) -> subprocess.CompletedProcess:
    return finished([*MAKE[ranks], WRITER, directory, *tasks], 240, env=environment())


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """`done(2, "write_all")`: the directory of a task that so many ranks have done; two do all in one launch."""

    @cache
    def launched(ranks, tasks):
        directory = tmp_path_factory.mktemp(f"ranks{ranks}")
        process = spawn(ranks, directory, *tasks)
        assert process.returncode == 0, process.stderr
        return directory

    return lambda ranks, task: launched(ranks, TASKS if ranks == 2 else (task,)) / task


def grids(stem: Path):
    """Times and grids as VTK's Xdmf2 reader gives them."""
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(str(stem) + ".xdmf")
    found = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grid = reader.read()
        found.append((time, grid[0] if isinstance(grid, pyvista.MultiBlock) else grid))
    return found


def connectivity(grid):
    return grid.cell_connectivity.reshape(grid.n_cells, -1)


def sorted_rows(grid):
    """Points with their values, in an order that does not depend on the numbering of nodes."""
    rows = np.column_stack([grid.points, grid["velocity"], grid["pressure"]])
    return rows[np.lexsort(np.round(grid.points, 9).T)]


@pytest.fixture(scope="module")
def directories(done):
    """What one rank and what two ranks have written."""
    return {ranks: done(ranks, "write_all") for ranks in MAKE}


@pytest.fixture(params=MAKE)
def written(request, directories):
    return directories[request.param]


def test_times_cells_and_bounds(written):
    found = grids(written / "fields")
    assert [time for time, _ in found] == [0.0, 0.5, 1.25, 2.0]
    for _, grid in found:
        assert set(grid.celltypes) == {QUADRATIC_TRIANGLE}
    assert np.allclose(found[1][1].bounds, (-1, 1, -1, 1, 0, 0))
    assert np.allclose(found[2][1].bounds, (-1, 1.2, -1, 1, 0, 0))  # x + 0.2 y^2
    assert found[3][1].n_cells > found[2][1].n_cells


def test_velocity_is_written_exactly(written):
    for _, grid in grids(written / "fields"):
        expected = np.column_stack([*velocity(grid.points.T), np.zeros(grid.n_points)])
        assert np.allclose(grid["velocity"], expected, atol=1e-14)


def test_linear_pressure_is_halved_at_mid_sides(written):
    for _, grid in grids(written / "fields")[:3]:
        p = grid["pressure"][connectivity(grid)]
        assert np.allclose(p[:, :3], pressure(grid.points.T)[connectivity(grid)[:, :3]], atol=1e-14)
        assert np.allclose(p[:, 3:], (p[:, :3] + p[:, [1, 2, 0]]) / 2, atol=1e-14)


def test_every_node_is_written_once_and_used(written):
    for _, grid in grids(written / "fields"):
        assert len(np.unique(np.round(grid.points, 10), axis=0)) == grid.n_points
        assert np.array_equal(np.unique(connectivity(grid)), np.arange(grid.n_points))


def test_mid_side_nodes_lie_on_the_curved_boundary(written):
    (_, grid) = grids(written / "fields")[0]
    distance = np.linalg.norm(grid.points, axis=1)
    assert np.count_nonzero(np.abs(distance - RADIUS) < 1e-9) >= 16
    assert distance.min() > RADIUS - 1e-9


def test_surface_of_the_hole(written):
    ((_, grid),) = grids(written / "surface")
    assert set(grid.celltypes) == {QUADRATIC_EDGE}
    assert np.allclose(
        np.linalg.norm(grid.points, axis=1), RADIUS, atol=2e-4
    )  # P2 nodes of cubic cells
    ends, middles = connectivity(grid)[:, :2], connectivity(grid)[:, 2]
    chords = np.linalg.norm(np.diff(grid.points[ends], axis=1), axis=2)
    assert np.allclose(chords, 2 * RADIUS * np.sin(np.pi / grid.n_cells))  # a regular polygon
    assert np.all(
        np.linalg.norm(grid.points[middles] - grid.points[ends].mean(axis=1), axis=1) < 0.2 * RADIUS
    )
    expected = np.column_stack([*velocity(grid.points.T), np.zeros(grid.n_points)])
    assert np.allclose(grid["velocity"], expected, atol=1e-14)


def test_nodes_of_cubic_geometry_are_pushed_through_it(written):
    ((_, grid),) = grids(written / "cubic")
    expected = np.column_stack([*velocity(grid.points.T), np.zeros(grid.n_points)])
    assert np.allclose(grid["velocity"], expected, atol=1e-13)
    assert np.allclose(grid["pressure"], pressure(grid.points.T), atol=1e-13)


@pytest.mark.parametrize(
    ("name", "cell_type", "edges"),
    [
        ("cube", QUADRATIC_TETRAHEDRON, [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]),
        ("skin", QUADRATIC_TRIANGLE, [(0, 1), (1, 2), (2, 0)]),
    ],
)
def test_order_of_nodes_in_space(written, name, cell_type, edges):
    ((_, grid),) = grids(written / name)
    assert set(grid.celltypes) == {cell_type}
    corners = len(connectivity(grid)[0]) - len(edges)
    points = grid.points[connectivity(grid)]
    for i, (a, b) in enumerate(edges):
        assert np.allclose(points[:, corners + i], (points[:, a] + points[:, b]) / 2)
    sizes = grid.compute_cell_sizes()
    assert (
        np.isclose(sizes["Volume"].sum(), 1)
        if name == "cube"
        else np.isclose(sizes["Area"].sum(), 6)
    )
    x, y, z = grid.points.T
    assert np.allclose(grid["velocity"], np.column_stack([x * y, x**2 - y, x * z]))


@pytest.fixture(scope="module", params=[pytest.param(1, marks=pytest.mark.slow), 2])
def moving(request, done):
    """Series of a body that moves, with what was written at each step."""
    directory = done(request.param, "write_moving")
    return directory, json.loads((directory / "steps.json").read_text())


def test_a_mesh_that_moves_and_is_made_anew(moving):
    directory, told = moving
    found = grids(directory / "fields")
    assert [time for time, _ in found] == [step["time"] for step in told]
    assert [grid.n_cells for _, grid in found] == [step["cells"] for step in told]
    assert [grid.n_points for _, grid in found] == [step["nodes"] for step in told]
    assert len({step["cells"] for step in told}) == len(CELLS)
    for _, grid in found:
        assert np.allclose(grid.bounds, (0, 2, 0, 1, 0, 0), atol=1e-12)
        expected = np.column_stack([*velocity(grid.points.T), np.zeros(grid.n_points)])
        assert np.allclose(grid["velocity"], expected, atol=1e-13)
        assert np.allclose(grid["pressure"], pressure(grid.points.T), atol=1e-13)


def test_the_surface_of_a_body_that_moves(moving):
    directory, told = moving
    found = grids(directory / "surface")
    assert [time for time, _ in found] == [step["time"] for step in told]
    assert len({grid.n_cells for _, grid in found}) > 1
    for number, (_, grid) in enumerate(found):
        place = placement(number)
        vertices = np.unique(connectivity(grid)[:, :2])
        across, up = place.to_body(grid.points[vertices, :2]).T / np.array(SEMI_AXES)[:, None]
        assert np.allclose(np.hypot(across, up), 1.0, atol=1e-6)
        assert np.allclose(grid["pressure"], pressure(grid.points.T), atol=1e-13)


def parts(stem):
    """Of each step which parts of the mesh it holds itself."""
    h5py, held = pytest.importorskip("h5py"), []
    for path in sorted(stem.glob("*.h5")):
        with h5py.File(path) as file:
            links = {name: file.get(name, getlink=True) for name in ("topology", "geometry")}
            held.append({name for name in links if isinstance(links[name], h5py.HardLink)})
    return held


def test_one_topology_for_each_mesh_and_one_geometry_for_each_step(moving):
    for name in ("fields", "surface"):
        of_a_mesh = [{"topology", "geometry"}, *[{"geometry"}] * (STEPS_A_MESH - 1)]
        assert parts(moving[0] / name) == of_a_mesh * len(CELLS)


PARAVIEW = """
import json, sys
from paraview import simple

found = {}
for reader, files in {"XDMFReader": "FileNames", "Xdmf3ReaderS": "FileName", "Xdmf3ReaderT": "FileName"}.items():
    for name in ("fields", "surface"):
        source = getattr(simple, reader)(**{files: [f"{sys.argv[1]}/{name}.xdmf"]})
        source.UpdatePipelineInformation()
        steps = found[f"{reader} {name}"] = []
        for time in source.TimestepValues:
            source.UpdatePipeline(time)
            about = source.GetDataInformation()
            arrays = {a.GetName(): [a.GetRange(-1), a.GetRange(0)] for a in source.PointData}
            steps.append([time, about.GetNumberOfCells(), about.GetNumberOfPoints(), about.GetBounds(), arrays])
print(json.dumps(found))
"""


@pytest.mark.slow
def test_paraview_opens_it(moving, tmp_path):
    """All of ParaView's own XDMF readers; whole fields vary with the place, so a wrong step or mesh shows."""
    pvpython = shutil.which("pvpython") or pytest.skip(
        "pvpython is not installed (python3-paraview)"
    )
    directory, told = moving
    script = tmp_path / "read.py"
    script.write_text(PARAVIEW)
    process = subprocess.run(
        [pvpython, script, directory], capture_output=True, text=True, timeout=300
    )
    assert process.returncode == 0, process.stderr
    assert "error" not in process.stderr.lower(), process.stderr
    seen = json.loads(process.stdout.splitlines()[-1])
    assert len(seen) == 6
    for (reader, name), steps in zip((key.split() for key in seen), seen.values(), strict=True):
        expected = grids(directory / name)
        assert [step[0] for step in steps] == [step["time"] for step in told], reader
        for (_, cells, points, bounds, arrays), (_, grid) in zip(steps, expected, strict=True):
            assert (cells, points) == (grid.n_cells, grid.n_points), reader
            assert np.allclose(bounds, grid.bounds), reader
            speed, p = np.linalg.norm(grid["velocity"], axis=1), grid["pressure"]
            assert np.allclose(arrays["velocity"][0], (speed.min(), speed.max())), reader
            assert np.allclose(arrays["pressure"][1], (p.min(), p.max())), reader


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_series_is_resumed(ranks, done):
    """What is later than the point from which it goes on is dropped."""
    directory = done(ranks, "write_and_resume")
    found = grids(directory / "fields")
    assert [time for time, _ in found] == times(directory / "fields") == [0.0, 0.1, 0.15, 0.2]
    assert np.allclose([grid.bounds[0] for _, grid in found], [-0.9, -0.8, -1.0, -1.0])
    assert found[1][1].n_cells < found[2][1].n_cells == found[3][1].n_cells
    assert np.isclose(read_step(directory / "fields", 1).points[:, 0].min(), -0.8)
    for _, grid in found:
        expected = np.column_stack([*velocity(grid.points.T), np.zeros(grid.n_points)])
        assert np.allclose(grid["velocity"], expected, atol=1e-13)


def test_same_data_from_any_number_of_ranks(directories):
    for name in ("fields", "surface", "cubic", "cube", "skin"):
        for (_, one), (_, two) in zip(
            grids(directories[1] / name), grids(directories[2] / name), strict=True
        ):
            assert one.n_cells == two.n_cells
            assert np.allclose(sorted_rows(one), sorted_rows(two), atol=1e-12)


def test_a_geometry_only_when_the_mesh_has_moved(written):
    both = {"topology", "geometry"}
    assert parts(written / "fields") == [both, set(), {"geometry"}, both]


def test_a_step_is_read_back_without_vtk(written):
    step = read_step(written / "fields")
    assert step.time == 2.0
    assert step.cells.max() == len(step.points) - 1
    assert np.allclose(step.fields["velocity"][:, :2].T, velocity(step.points.T))


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_full_disk_is_one_error_on_all_ranks_and_loses_nothing(ranks, done):
    directory = done(ranks, "write_until_full")
    said = {(directory / f"said{rank}").read_text() for rank in range(ranks)}
    (message,) = said
    assert "fields/000001.h5: cannot be written: file too large; raise the limit" in message
    assert [time for time, _ in grids(directory / "fields")] == [0.0, 2.0]


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_missing_directory_is_one_error_on_all_ranks(ranks, done):
    directory = done(ranks, "write_where_impossible")
    for rank in range(ranks):
        assert "make the directory first" in (directory / f"said{rank}").read_text()
