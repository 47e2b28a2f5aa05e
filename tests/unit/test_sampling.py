"""Values of fields at points, and files of fields."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import dolfinx
import h5py
import numpy as np
import pytest
from domains import ball_in_box, bent_box, ring, square_in_box, unit_box
from environment import environment, finished, grids, on_ranks
from xdmf_writer import RADIUS, pressure, velocity

from incipient import compat
from incipient.errors import OutputError
from incipient.fluid.space import geometry_function
from incipient.mesh.sampling import Locator, Transfer, evaluate
from incipient.output.series_file import SeriesFile, read_step, times

# Cells that hold points, values of fields there, extrema along lines, and fields taken to another mesh.


Values = Callable[[np.ndarray], np.ndarray]


def places_again(mesh: Any, places: Any) -> Any:
    """Where the places found are in space."""
    identity = geometry_function(mesh)
    identity.interpolate(lambda x: x[: mesh.geometry.dim])
    return evaluate(identity, places)


def skew_box(gdim: int) -> Any:
    mesh = unit_box(gdim, 4).mesh
    mesh.geometry.x[:, 1] += 0.8 * mesh.geometry.x[:, 0]
    return mesh


def within(radius: float, centre: Sequence[float]) -> np.ndarray:
    directions = np.random.default_rng(9).standard_normal((60, len(centre)))
    return centre + radius * directions / np.linalg.norm(directions, axis=1)[:, None]


def beside(gdim: int) -> np.ndarray:
    points = np.random.default_rng(4).random((60, gdim))
    points[:, 0] = -np.linspace(1e-3, 0.3, 60)
    return points


@pytest.mark.parametrize(
    ("mesh", "points", "distances", "close"),
    [
        # Outside a corner, and outside a side, however skew the cells behind it.
        (lambda: unit_box(2, 4).mesh, np.full((1, 2), 1.1), 0.1 * np.sqrt(2), 1e-9),
        (lambda: unit_box(3, 4).mesh, np.full((1, 3), 1.1), 0.1 * np.sqrt(3), 1e-9),
        (lambda: skew_box(2), beside(2), -beside(2)[:, 0], 1e-9),
        (lambda: skew_box(3), beside(3), -beside(3)[:, 0], 1e-9),
        # The round hole of radius 1/2 seen from within, and a ball of radius 1/4.
        (lambda: ring(0.5, 1.0, 24, 2).mesh, within(0.45, (0.0, 0.0)), 0.05, 0.02),
        (lambda: ring(0.5, 1.0, 24, 3).mesh, within(0.45, (0.0, 0.0)), 0.05, 0.02),
        (lambda: ball_in_box(0.35).mesh, within(0.24, (0.6, 0.5, 0.5)), 0.01, 0.1),
        # Straight cells go on for ever; the map of a curved one may have no inverse there, then a near point counts.
        (
            lambda: unit_box(2, 3).mesh,
            np.array([[30.0, -40.0], [0.0, 1000.0]]),
            [49.4, 999.0],
            0.01,
        ),
        (lambda: bent_box(2, 3, 2), np.array([[30.0, -40.0], [0.0, 1000.0]]), [49.4, 999.0], 0.01),
    ],
)
def test_distances_outside(mesh: Any, points: np.ndarray, distances: Any, close: float) -> None:
    """The nearest point of a corner, a side or a curved boundary; its cell's map goes on to the point."""
    outside = mesh()
    nearest = Locator(outside).nearest(points)
    assert nearest.located.all() and np.isfinite(nearest.reference).all()
    assert nearest.distances == pytest.approx(np.broadcast_to(distances, len(points)), rel=close)
    if np.max(distances) < 1.0:
        assert places_again(outside, nearest) == pytest.approx(points, abs=1e-10)


def test_a_flat_cell_holds_nothing() -> None:
    """Nor does it stop the search; the rest of the mesh is found."""
    mesh = unit_box(2, 2).mesh
    cell = compat.geometry_dofs(mesh)[0]
    corners = [tuple(mesh.geometry.x[k]) for k in cell]
    middle = np.mean(corners, axis=0)
    mesh.geometry.x[cell[0]] = mesh.geometry.x[cell[1:]].mean(axis=0)
    places = Locator(mesh).inside(np.vstack([middle, mesh.geometry.x]))
    assert 0 not in places.cells


RANKS_THAT_SAMPLE = """
import sys
import numpy as np
from mpi4py import MPI
import dolfinx
from domains import unit_box
from incipient import compat
from incipient.mesh.sampling import cells_between, sample

mesh = unit_box(2, 4).mesh
function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 2), (2,)))
function.interpolate(lambda x: np.vstack([x[0], x[1] ** 2]))
points = np.array([[0.1, 0.1], [0.9, 0.9], [0.5, 0.5], [2.0, 2.0]])
values = sample(function, points)
assert np.allclose(values[:3], np.column_stack([points[:3, 0], points[:3, 1] ** 2]), atol=1e-12)
assert np.isnan(values[3]).all()
assert cells_between(mesh, (0.0, 0.1), (1.0, 0.1)) == 8
assert cells_between(mesh, (0.1, 0.0), (0.1, 1.0)) == 8
if MPI.COMM_WORLD.allreduce(1) == 2 and MPI.COMM_WORLD.rank == 0:
    print("good")
"""


def test_all_ranks_get_all_values(mpirun: Any) -> None:
    assert mpirun(2, RANKS_THAT_SAMPLE).stdout == "good\n"


# -- transfer ------------------------------------------------------------------------------------


def field(mesh: Any, order: int, values: Values, components: int = 1) -> Any:
    shape = (components,) if components > 1 else ()
    function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", order), shape))
    function.interpolate(values)
    return function


def polynomials(degree: int, components: int) -> Values:
    """Full polynomials of a degree in all coordinates, one a component."""
    slopes = np.random.default_rng(6).standard_normal((components, 3))
    return lambda x: np.squeeze(
        (0.3 + slopes @ x) ** degree - slopes @ x, axis=0 if components == 1 else ()
    )


def straight(gdim: int, n: int) -> Any:
    """Meshes that share no inner node; in the plane about the same hole."""
    return square_in_box(0.3, 0.9 / n).mesh if gdim == 2 else unit_box(3, n).mesh


@pytest.mark.parametrize(
    ("gdim", "bend", "order", "degree", "components"),
    [
        *((2, 1, order, order, components) for order in (2, 3, 4) for components in (1, 2)),
        *((3, 1, order, order, components) for order, components in ((2, 3), (3, 1), (4, 3))),
        *((2, 2, 2, 1, 2), (2, 2, 4, 2, 2), (2, 3, 3, 1, 2), (2, 3, 4, 1, 2)),
        *((3, 2, 2, 1, 3), (3, 2, 4, 2, 3)),
    ],
)
def test_polynomials_are_exact(
    gdim: int, bend: int, order: int, degree: int, components: int
) -> None:
    """Of the elements' own degree; cells bent by a map of degree g hold polynomials of degree k/g in space."""
    source, target = (
        bent_box(gdim, n, bend) if bend > 1 else straight(gdim, n + (gdim == 2)) for n in (2, 3)
    )
    values = polynomials(degree, components)
    points = compat.space(target, ("Lagrange", order)).tabulate_dof_coordinates()
    transfer = Transfer(source, points)
    assert transfer.outside == 0 and transfer.farthest == 0.0
    result = transfer.values(field(source, order, values, components))
    assert result == pytest.approx(values(points.T).reshape(components, -1).T, abs=1e-11)


def test_points_outside_may_take_the_value_next_to_them() -> None:
    """What is steep at a boundary is not extrapolated: values stay between those of the cell, points inside do."""
    source = unit_box(2, 4).mesh
    s = np.linspace(0.05, 0.95, 10)
    points = np.column_stack([-0.1 * s, s, 0 * s])
    points[::5, 0] = 0.1

    def steep(x: np.ndarray) -> np.ndarray:
        return np.array([1000.0 * x[0] ** 2 - 500.0 * x[0], x[1]])

    known = field(source, 2, steep, 2)
    result = Transfer(source, points, reach=0.0).values(known)
    assert result[::5] == pytest.approx(steep(points[::5].T).T, abs=1e-10)
    outside = np.delete(result, [0, 5], axis=0)
    assert (outside[:, 0] <= 1e-10).all() and (outside[:, 0] >= -62.5).all()
    assert outside[:, 1] == pytest.approx(np.delete(s, [0, 5]), abs=0.25)
    extrapolated = np.delete(Transfer(source, points).values(known), [0, 5], axis=0)
    assert (extrapolated[:, 0] > 1.0).all()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_round_boundary_meshed_anew(order: int) -> None:
    """Nodes off the old mesh lie out by what its cells cut off the circle, less than h^2/8; a line is exact."""
    source, target = ring(0.5, 1.0, 20, order).mesh, ring(0.5, 1.0, 28, order).mesh
    transfer = Transfer(source, target.geometry.x)
    assert transfer.outside > 0
    assert transfer.farthest < 1.5 * (2 * np.pi / 20) ** 2 / 8
    if order > 1:
        assert transfer.farthest < 2e-4
    values = polynomials(1, 2)
    result = transfer.values(field(source, max(order, 2), values, 2))
    assert result == pytest.approx(values(target.geometry.x.T).T, abs=1e-11)


RANKS_THAT_TRANSFER = """
import json
from mpi4py import MPI
import dolfinx
import numpy as np
from domains import ring
from incipient import compat
from incipient.mesh.sampling import Transfer

comm = MPI.COMM_WORLD
mesh = ring(0.5, 1.0, 20, 2).mesh
function = dolfinx.fem.Function(compat.space(mesh, ("Lagrange", 3), (2,)))
function.interpolate(lambda x: np.vstack([np.sin(3 * x[0]) * x[1], np.exp(x[0])]))
function.x.scatter_forward()
# Drawn the same on all ranks: some within, many out by a little, some by a lot. The last rank has none.
random = np.random.default_rng(8)
angles, radii = random.uniform(0.0, 6.3, 400), np.repeat([0.4, 0.4999, 0.75, 1.02], 100)
points = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
askers = max(comm.size - 1, 1)
mine = np.arange(comm.rank, 400, askers) if comm.rank < askers else np.arange(0)
transfer = Transfer(mesh, points[mine])
gathered = comm.gather((mine, transfer.values(function)))
if comm.rank == 0:
    values = np.empty((400, 2))
    for rows, theirs in gathered:
        values[rows] = theirs
    print(json.dumps([comm.size, transfer.outside, transfer.farthest, values.tolist()]))
"""


@pytest.mark.slow
def test_ranks_agree_with_one(mpirun: Any) -> None:
    """Wherever the points are asked for and the cells are: of three ranks two ask."""
    result = [json.loads(mpirun(n, RANKS_THAT_TRANSFER).stdout) for n in (1, 3)]
    (one, outside, farthest, values), (three, *rest) = result
    assert (one, three) == (1, 3)
    assert outside == 300
    assert farthest == pytest.approx(0.1, rel=0.02)
    assert rest[0] == outside
    assert rest[1] == pytest.approx(farthest, rel=1e-9)
    assert np.array(rest[2]) == pytest.approx(np.array(values), abs=1e-9)


# Fields written on one and two ranks (by xdmf_writer.py), read back with VTK's Xdmf2 reader.
#
# Expected values are the polynomials written; mid-side nodes are recomputed from their definition.


WRITER = Path(__file__).with_name("xdmf_writer.py")
# Numbers of cells as in vtkCellType.h, pairs of corners with a node between them, and what cells measure together.
EDGE, TRIANGLE, TETRAHEDRON = 21, 22, 24
SIDES = [(0, 1), (1, 2), (2, 0)]
STILL = {
    "plane": (TRIANGLE, SIDES, 4 - np.pi * RADIUS**2),
    "rim": (EDGE, [(0, 1)], 2 * np.pi * RADIUS),
    "cube": (TETRAHEDRON, [*SIDES, (0, 3), (1, 3), (2, 3)], 1.0),
    "skin": (TRIANGLE, SIDES, 6.0),
}


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """What one rank and what two ranks have written."""
    where = {"PYTHONPATH": f"{WRITER.parents[1]}:{WRITER.parents[2]}"}
    directories = [tmp_path_factory.mktemp(f"ranks{ranks}") for ranks in (1, 2)]
    for ranks, directory in enumerate(directories, 1):
        command = [*on_ranks(ranks), sys.executable, WRITER, directory]
        finished(command, 240, env=environment() | where)
    return directories


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
def test_values_are_at_their_nodes_and_nodes_in_vtk_s_order(still, name):
    """From one and two ranks the same; mid-side nodes are between their corners, on curved sides nearly so."""
    cell_type, sides, measure = STILL[name]
    one, two = (grids(directory / name) for directory in still)
    ((time, grid),) = one.items()
    assert time == 0.0 and set(grid.celltypes) == {cell_type}
    assert np.allclose(sorted_rows(grid), sorted_rows(two[0.0]), atol=1e-12)
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
        assert np.allclose(p[:, number], (p[:, a] + p[:, b]) / 2, atol=1e-13)
    sizes = grid.compute_cell_sizes()
    result = max(sizes[kind].sum() for kind in ("Length", "Area", "Volume"))
    assert result == pytest.approx(measure, rel=1e-12 if straight else 2e-2)


# Series of fields, a file for each step: open to VTK after every step, whole after a kill, damaged.


# Two quadratic triangles that share a side, which is curved.
POINTS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0, 0), (1, 0.5, 0), (0.4, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0)],
    dtype=float,
)  # fmt: skip
CELLS_OF_SERIES = np.array([(0, 1, 2, 4, 5, 6), (0, 2, 3, 6, 7, 8)], dtype=np.int32)
MESH = {"topology": CELLS_OF_SERIES, "geometry": POINTS}


def fields_at(time: float) -> dict[str, np.ndarray]:
    return {"velocity": time + POINTS, "pressure": time * POINTS[:, 0]}


def written(stem: Path, steps: int) -> SeriesFile:
    """A series with steps at 0, 1, 2 ..."""
    file = SeriesFile(stem, "Triangle_6")
    file.begin()
    for number in range(steps):
        file.add_step(number, fields_at(number), {} if number else MESH)
    return file


def shown(stem: Path) -> list[float]:
    """Times at which VTK's reader shows the fields that `fields_at` gives."""
    result = grids(stem)
    for moment, grid in result.items():
        assert np.array_equal(connectivity(grid), CELLS_OF_SERIES)
        for name, values in fields_at(moment).items():
            assert np.array_equal(grid[name], values)
    return list(result)


def test_vtk_shows_all_steps_after_each(tmp_path: Path) -> None:
    """From the first one on, which is all that there is of a steady flow; of meshes that move and are made anew."""
    file = written(tmp_path / "fields", 1)
    assert shown(tmp_path / "fields") == [0.0]
    for number in (1, 2):
        file.add_step(number, fields_at(number), {})
        assert shown(tmp_path / "fields") == times(tmp_path / "fields") == [*range(number + 1)]
    with h5py.File(tmp_path / "fields" / "000002.h5") as step:
        files = [step.get(name, getlink=True).filename for name in ("topology", "geometry")]
    assert files == ["000000.h5"] * 2  # a mesh is stored once
    file.add_step(3, fields_at(3), {"geometry": 2.0 * POINTS})
    file.add_step(4, fields_at(4), {"topology": CELLS_OF_SERIES[::-1], "geometry": 3.0 * POINTS})
    file.add_step(5, fields_at(5), {})
    result = grids(tmp_path / "fields")
    for moment, size in ((2.0, 1.0), (3.0, 2.0), (4.0, 3.0), (5.0, 3.0)):
        assert np.array_equal(result[moment].points, size * POINTS)
        assert np.array_equal(result[moment]["velocity"], fields_at(moment)["velocity"])
    assert np.array_equal(connectivity(result[3.0]), CELLS_OF_SERIES)
    assert np.array_equal(connectivity(result[5.0]), CELLS_OF_SERIES[::-1])


WRITER_OF_SERIES = """
import sys
from pathlib import Path
from test_sampling import written
print("begun", flush=True)
written(Path(sys.argv[1]), 10_000)
"""


@pytest.mark.slow
def test_a_writer_killed_at_any_moment_leaves_whole_steps(tmp_path: Path) -> None:
    """SIGKILL, eight times; all steps but the one under way are there, and the series resumes behind any of them."""
    random, here = np.random.default_rng(5), str(Path(__file__).parent)
    for number in range(8):
        stem = tmp_path / f"fields{number}"
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER_OF_SERIES, str(stem)],
            env=environment() | {"PYTHONPATH": f"{here}:{Path(here).parent}"},
            stdout=subprocess.PIPE,
        )
        assert writer.stdout is not None and writer.stdout.readline() == b"begun\n"
        while not stem.with_suffix(".xdmf").exists():  # the first step may take long to begin
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, 0.3))
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
        result = times(stem)
        assert result == [*range(len(result))]
        for index in (0, -1):
            step = read_step(stem, index)
            assert np.array_equal(step.fields["velocity"], fields_at(step.time)["velocity"])
        assert len(shown(stem)) in (len(result), len(result) - 1)
        again = SeriesFile(stem, "Triangle_6")
        again.begin(after=result[-1] / 2)
        again.add_step(1e6, fields_at(1e6), MESH)
        kept = [one for one in result if one <= result[-1] / 2]
        assert shown(stem) == times(stem) == [*kept, 1e6]


def test_a_damaged_step_is_refused_and_put_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """One byte of a value, which HDF5's checksum notices; a file cut in half does not stop a run that resumes."""
    stem = tmp_path / "fields"
    written(stem, 4)
    path = stem / "000001.h5"
    content = path.read_bytes()
    at = content.index(fields_at(1)["pressure"].tobytes())
    path.write_bytes(content[: at + 6] + b"\x55" + content[at + 7 :])
    with pytest.raises(OutputError, match=r"000001\.h5: cannot be read: it is damaged or incomp"):
        read_step(stem, 1)
    path.write_bytes(content[:2000])
    SeriesFile(stem, "Triangle_6").begin(after=2.0)
    assert shown(stem) == times(stem) == [0.0, 2.0]
    assert (stem / "000001.h5.1").read_bytes() == content[:2000]
    (told,) = [record.getMessage() for record in caplog.records]
    assert told.endswith(f"it is damaged or incomplete; it is now {stem / '000001.h5.1'}")


def test_a_series_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"fields: holds no fields; run the scene with output\.f"):
        times(tmp_path / "fields")
