"""Fields written on one and two ranks (by xdmf_writer.py), read back with VTK's Xdmf2 reader.

ParaView's own readers, three of them, read the same files where pvpython is installed.

Expected values are the polynomials written; mid-side nodes are recomputed from their definition.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from environment import environment, finished, on_ranks
from xdmf_writer import CELLS, RADIUS, SEMI_AXES, STEPS_A_MESH, placement, pressure, velocity

from incipient.output.series_file import read_step

WRITER = Path(__file__).with_name("xdmf_writer.py")
MAKE = {1: [sys.executable], 2: [*on_ranks(2), sys.executable]}
TASKS = {1: ("write_still",), 2: ("write_still", "write_moving", "write_until_full")}
# Numbers of cells as in vtkCellType.h, pairs of corners with a node between them, and what cells measure together.
EDGE, TRIANGLE, TETRAHEDRON = 21, 22, 24
SIDES = [(0, 1), (1, 2), (2, 0)]
STILL = {
    "plane": (TRIANGLE, SIDES, 4 - np.pi * RADIUS**2),
    "rim": (EDGE, [(0, 1)], 2 * np.pi * RADIUS),
    "cubic": (TRIANGLE, SIDES, 4 - np.pi * RADIUS**2),
    "cube": (TETRAHEDRON, [*SIDES, (0, 3), (1, 3), (2, 3)], 1.0),
    "skin": (TRIANGLE, SIDES, 6.0),
}


def spawn(ranks: int, directory: Path, *tasks: str) -> Path:
    process = finished([*MAKE[ranks], WRITER, directory, *tasks], 240, env=environment())
    assert process.returncode == 0, process.stderr
    return directory


@pytest.fixture(scope="module")
def directories(tmp_path_factory):
    """What one rank and what two ranks have written."""
    return {
        ranks: spawn(ranks, tmp_path_factory.mktemp(f"ranks{ranks}"), *TASKS[ranks])
        for ranks in MAKE
    }


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


def fields_of(points):
    """The polynomials that are written, at points."""
    x, y, z = points.T
    return np.column_stack([*velocity((x, y)), x * z]), pressure((x, y))


def sorted_rows(grid):
    """Points with their values, in an order that does not depend on the numbering of nodes."""
    rows = np.column_stack([grid.points, grid["velocity"], grid["pressure"]])
    return rows[np.lexsort(np.round(grid.points, 9).T)]


@pytest.mark.slow
@pytest.mark.parametrize("name", STILL)
def test_values_are_at_their_nodes_and_nodes_in_vtk_s_order(directories, name):
    """From one and two ranks the same; mid-side nodes are between their corners, on curved sides nearly so."""
    cell_type, sides, measure = STILL[name]
    one, two = (grids(directories[ranks] / "write_still" / name) for ranks in MAKE)
    ((time, grid),) = one
    assert time == 0.0 and set(grid.celltypes) == {cell_type}
    assert np.allclose(sorted_rows(grid), sorted_rows(two[0][1]), atol=1e-12)
    cells = connectivity(grid)
    assert np.array_equal(np.unique(cells), np.arange(grid.n_points))
    assert len(np.unique(np.round(grid.points, 10), axis=0)) == grid.n_points
    expected, exact = fields_of(grid.points)
    assert np.allclose(grid["velocity"], expected, atol=1e-13)
    corners, p = cells.shape[1] - len(sides), grid["pressure"][cells]
    assert np.allclose(p[:, :corners], exact[cells][:, :corners], atol=1e-13)
    points, straight = grid.points[cells], name in ("cube", "skin")
    for number, (a, b) in enumerate(sides, corners):
        chord = np.linalg.norm(points[:, a] - points[:, b], axis=1)
        away = points[:, number] - (points[:, a] + points[:, b]) / 2
        assert np.all(np.linalg.norm(away, axis=1) <= (1e-12 if straight else 0.2) * chord)
        if name != "cubic":  # whose pressure is not linear in a cell
            assert np.allclose(p[:, number], (p[:, a] + p[:, b]) / 2, atol=1e-13)
    sizes = grid.compute_cell_sizes()
    found = max(sizes[kind].sum() for kind in ("Length", "Area", "Volume"))
    assert found == pytest.approx(measure, rel=1e-12 if straight else 2e-2)


@pytest.mark.parametrize("name", ["plane", "rim"])
def test_nodes_lie_on_the_curved_boundary(directories, name):
    """Of quadratic cells exactly; the quadratic nodes of cubic cells nearly so."""
    ((_, grid),) = grids(directories[2] / "write_still" / name)
    distance = np.linalg.norm(grid.points, axis=1)
    near = {"plane": 1e-9, "rim": 2e-4}[name]
    assert np.count_nonzero(np.abs(distance - RADIUS) < near) >= 16
    assert distance.min() > RADIUS - near


@pytest.fixture(scope="module")
def moving(directories):
    """Series of a body that moves, written on two ranks, with what was written at each step."""
    directory = directories[2] / "write_moving"
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
        for name, expected in zip(("velocity", "pressure"), fields_of(grid.points), strict=True):
            assert np.allclose(grid[name], expected, atol=1e-13)
    step = read_step(directory / "fields")
    assert step.time == told[-1]["time"] and np.array_equal(step.points, found[-1][1].points)


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


def test_a_full_disk_is_one_error_on_all_ranks_and_loses_nothing(directories):
    directory = directories[2] / "write_until_full"
    said = [json.loads((directory / f"said{rank}.json").read_text()) for rank in range(2)]
    assert said[0] == said[1]
    full, missing = said[0]
    assert "fields/000001.h5: cannot be written: file too large; raise the limit" in full
    assert "make the directory first" in missing
    assert [time for time, _ in grids(directory / "fields")] == [0.0, 2.0]
