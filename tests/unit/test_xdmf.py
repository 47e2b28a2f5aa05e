"""Fields written on one and two ranks, read back with VTK's Xdmf2 reader; as a script this file writes them.

Expected values are the polynomials written; mid-side nodes are recomputed from their definition.
"""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

MAKE = {1: [sys.executable], 2: ["mpirun", "-n", "2", "--oversubscribe", sys.executable]}
QUADRATIC_EDGE, QUADRATIC_TRIANGLE, QUADRATIC_TETRAHEDRON = 21, 22, 24  # vtkCellType.h
RADIUS = 0.4


def spawn(ranks: int, task: str, directory: Path) -> subprocess.CompletedProcess:
    environment = os.environ | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMP_NUM_THREADS": "1",
    }
    command = [*MAKE[ranks], __file__, task, str(directory)]
    return subprocess.run(command, env=environment, timeout=120, capture_output=True, text=True)


# -- the writer, run in processes of their own ---------------------------------------------------------------


def velocity(x):
    return np.array([x[0] * x[1], x[0] ** 2 - x[1]])


def pressure(x):
    return 1 + 2 * x[0] - x[1]


def holed_square(order, size):
    """Unit-centred square of side 2 with a round hole, cells of a geometric order, and the hole's facets."""
    import gmsh
    from mpi4py import MPI

    from incipient import compat

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if MPI.COMM_WORLD.rank == 0:
        make = gmsh.model.occ
        make.cut([(2, make.addRectangle(-1, -1, 0, 2, 2))], [(2, make.addDisk(0, 0, 0, RADIUS, RADIUS))])
        make.synchronize()
        hole = [c for c in gmsh.model.getEntities(1) if gmsh.model.getType(*c) not in ("Line",)]
        gmsh.model.addPhysicalGroup(2, [1], 1)
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in hole], 7)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
    mesh, _, facets = compat.model_to_mesh(gmsh.model, MPI.COMM_WORLD, 2)
    gmsh.finalize()
    return mesh, facets.find(7)


def functions(mesh, degree=2):
    from dolfinx.fem import Function

    from incipient import compat

    u = Function(compat.space(mesh, ("Lagrange", degree), (mesh.geometry.dim,)))
    u.interpolate(lambda x: np.vstack([velocity(x), x[2:3] * x[0:1]])[: mesh.geometry.dim])
    p = Function(compat.space(mesh, ("Lagrange", degree - 1)))
    p.interpolate(pressure)
    return {"velocity": u, "pressure": p}


def write_all(directory: Path) -> None:
    from dolfinx.mesh import create_unit_cube
    from mpi4py import MPI

    from incipient import compat
    from incipient.output.xdmf import FieldSeries, SurfaceSeries

    comm = MPI.COMM_WORLD
    mesh, hole = holed_square(2, 0.4)
    with FieldSeries(directory / "fields", mesh, comm) as series:
        series.write(0.0, functions(mesh))
        series.write(0.5, functions(mesh))
        mesh.geometry.x[:, 0] += 0.2 * mesh.geometry.x[:, 1] ** 2
        series.write(1.25, functions(mesh))
        mesh, _ = holed_square(2, 0.25)
        series.remeshed(mesh)
        series.write(2.0, functions(mesh, degree=4))  # x^2 on quadratic cells is quartic
    mesh, hole = holed_square(3, 0.4)
    SurfaceSeries(directory / "surface", mesh, hole, comm).write(0.0, functions(mesh))
    FieldSeries(directory / "cubic", mesh, comm).write(0.0, functions(mesh, degree=4))
    cube = create_unit_cube(comm, 2, 2, 2)
    FieldSeries(directory / "cube", cube, comm).write(0.0, functions(cube))
    skin = SurfaceSeries(directory / "skin", cube, compat.exterior_facets(cube), comm)
    skin.write(0.0, functions(cube))


def write_and_crash(directory: Path) -> None:
    from mpi4py import MPI

    from incipient.output.xdmf import FieldSeries

    mesh, _ = holed_square(2, 0.8)
    series = FieldSeries(directory / "fields", mesh, MPI.COMM_WORLD)
    for time in (0.0, 1.0):
        series.write(time, functions(mesh))
    os.kill(os.getpid(), signal.SIGKILL)


def write_until_full(directory: Path) -> None:
    from mpi4py import MPI

    from incipient.errors import OutputError
    from incipient.output.xdmf import FieldSeries

    mesh, _ = holed_square(2, 0.4)
    series = FieldSeries(directory / "fields", mesh, MPI.COMM_WORLD)
    series.write(0.0, functions(mesh))
    if MPI.COMM_WORLD.rank == 0:
        size = (directory / "fields.h5").stat().st_size
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 1000, resource.RLIM_INFINITY))
    said = ""
    try:
        series.write(1.0, functions(mesh))
    except OutputError as error:
        said = str(error)
    if MPI.COMM_WORLD.rank == 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    (directory / f"said{MPI.COMM_WORLD.rank}").write_text(said)
    if (directory / "go-on").exists():
        series.write(2.0, functions(mesh))


def write_where_impossible(directory: Path) -> None:
    from mpi4py import MPI

    from incipient.errors import OutputError
    from incipient.output.xdmf import FieldSeries

    mesh, _ = holed_square(2, 0.8)
    try:
        FieldSeries(directory / "absent" / "fields", mesh, MPI.COMM_WORLD)
    except OutputError as error:
        (directory / f"said{MPI.COMM_WORLD.rank}").write_text(str(error))


# -- reading back --------------------------------------------------------------------------------------------


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
def directories(tmp_path_factory):
    """What one rank and what two ranks have written."""
    found = {}
    for ranks in MAKE:
        found[ranks] = tmp_path_factory.mktemp(f"ranks{ranks}")
        process = spawn(ranks, "write_all", found[ranks])
        assert process.returncode == 0, process.stderr
    return found


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
    assert np.allclose(np.linalg.norm(grid.points, axis=1), RADIUS, atol=2e-4)  # P2 nodes of cubic cells
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
    assert np.isclose(sizes["Volume"].sum(), 1) if name == "cube" else np.isclose(sizes["Area"].sum(), 6)
    x, y, z = grid.points.T
    assert np.allclose(grid["velocity"], np.column_stack([x * y, x**2 - y, x * z]))


def test_same_data_from_any_number_of_ranks(directories):
    for name in ("fields", "surface", "cubic", "cube", "skin"):
        for (_, one), (_, two) in zip(
            grids(directories[1] / name), grids(directories[2] / name), strict=True
        ):
            assert one.n_cells == two.n_cells
            assert np.allclose(sorted_rows(one), sorted_rows(two), atol=1e-12)


def test_no_xpointer_one_topology_and_geometry_only_when_moved(written):
    text = (written / "fields.xdmf").read_text()
    assert "xpointer" not in text and "XInclude" not in text
    assert text.count('Precision="8"') == text.count("<DataItem")
    h5py = pytest.importorskip("h5py")
    with h5py.File(written / "fields.h5") as file:
        assert set(file["mesh0"]) == {"topology", "geometry0", "geometry1"}
        assert set(file["mesh1"]) == {"topology", "geometry0"}


def test_a_step_is_read_back_without_vtk(written):
    from incipient.output.series_file import read_step

    step = read_step(written / "fields")
    assert step.time == 2.0
    assert step.cells.max() == len(step.points) - 1
    assert np.allclose(step.fields["velocity"][:, :2].T, velocity(step.points.T))


@pytest.mark.parametrize("ranks", [1, 2])
def test_readable_after_a_crash(ranks, tmp_path):
    assert spawn(ranks, "write_and_crash", tmp_path).returncode != 0
    found = grids(tmp_path / "fields")
    assert [time for time, _ in found] == [0.0, 1.0]
    assert np.isfinite(found[-1][1]["velocity"]).all()


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_full_disk_is_one_error_on_all_ranks_and_loses_nothing(ranks, tmp_path):
    (tmp_path / "go-on").touch()
    process = spawn(ranks, "write_until_full", tmp_path)
    assert process.returncode == 0, process.stderr
    said = {(tmp_path / f"said{rank}").read_text() for rank in range(ranks)}
    (message,) = said
    assert "fields.h5: cannot be written: file too large; raise the limit" in message
    assert [time for time, _ in grids(tmp_path / "fields")] == [0.0, 2.0]


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_missing_directory_is_one_error_on_all_ranks(ranks, tmp_path):
    process = spawn(ranks, "write_where_impossible", tmp_path)
    assert process.returncode == 0, process.stderr
    for rank in range(ranks):
        assert "make the directory first" in (tmp_path / f"said{rank}").read_text()


if __name__ == "__main__":
    globals()[sys.argv[1]](Path(sys.argv[2]))
