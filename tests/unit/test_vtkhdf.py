"""The VTKHDF file beside a series: what VTK's own reader makes of it, against what was written."""

from pathlib import Path

import numpy as np
import pytest
from test_series_file import CELLS, POINTS, fields_at, opened

from incipient.errors import OutputError
from incipient.output.series_file import SeriesFile
from incipient.output.vtkhdf import write_vtkhdf

hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
pytest.importorskip("vtkmodules.vtkCommonCore")
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402
from vtkmodules.vtkCommonCore import vtkVersion  # noqa: E402

VERSION = vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()
pytestmark = pytest.mark.skipif(
    VERSION < (9, 3), reason="VTK before 9.3 reads no series of this format"
)


def reader_of(path: Path) -> object:
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    return reader


def read(
    reader: object, time: float | None = None
) -> tuple[np.ndarray, list[list[int]], dict[str, np.ndarray]]:
    """Points, the nodes of every cell, and fields."""
    reader.Update() if time is None else reader.UpdateTimeStep(time)  # type: ignore[attr-defined]
    grid = reader.GetOutputDataObject(0)  # type: ignore[attr-defined]
    cells = [grid.GetCell(i) for i in range(grid.GetNumberOfCells())]
    ids = []
    for index in range(len(cells)):
        cell = grid.GetCell(index)
        ids.append([cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())])
    data = grid.GetPointData()
    fields = {
        data.GetArrayName(i): vtk_to_numpy(data.GetArray(i))
        for i in range(data.GetNumberOfArrays())
    }
    return vtk_to_numpy(grid.GetPoints().GetData()), ids, fields


def same(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    return set(found) == set(expected) and all(
        np.array_equal(found[name], expected[name]) for name in found
    )


def test_a_steady_flow_is_one_grid(tmp_path: Path) -> None:
    opened(tmp_path / "fields", steady=True).add_step(0.0, fields_at(2.0))
    path = write_vtkhdf(tmp_path / "fields.h5", "Triangle_6", steady=True)
    points, cells, fields = read(reader_of(path))
    assert path.name == "fields.vtkhdf" and np.array_equal(points, POINTS)
    assert cells == CELLS.tolist() and same(fields, fields_at(2.0))


def test_a_series_moves_and_gets_a_new_mesh(tmp_path: Path) -> None:
    """Five steps: two on the first mesh, one where it has moved, two on another of half as many cells."""
    file, stem = opened(tmp_path / "fields"), tmp_path / "fields"
    few, half = POINTS[[0, 1, 2, 4, 5, 6]] + 1.0, np.arange(6)[None, :]
    file.add_step(0.0, fields_at(0.0))
    file.add_step(0.5, fields_at(1.0))
    file.add_geometry(2.0 * POINTS)
    file.add_step(1.0, fields_at(2.0))
    file.add_mesh(half)
    file.add_geometry(few)
    later = [{"velocity": k * few, "pressure": k * few[:, 0]} for k in (3.0, 4.0)]
    file.add_step(1.5, later[0])
    file.add_step(2.0, later[1])
    reader = reader_of(write_vtkhdf(stem.with_suffix(".h5"), "Triangle_6", steady=False))
    expected = [
        (0.0, POINTS, CELLS, fields_at(0.0)),
        (0.5, POINTS, CELLS, fields_at(1.0)),
        (1.0, 2.0 * POINTS, CELLS, fields_at(2.0)),
        (1.5, few, half, later[0]),
        (2.0, few, half, later[1]),
    ]
    for time, points, cells, fields in [*expected, expected[0]]:
        found = read(reader, time)
        assert (
            np.array_equal(found[0], points)
            and found[1] == cells.tolist()
            and same(found[2], fields)
        )


def test_no_table_is_stored_twice(tmp_path: Path) -> None:
    count = 20_000
    file = SeriesFile(tmp_path / "fields", "Triangle_6")
    file.create()
    file.add_mesh(np.arange(count - count % 6).reshape(-1, 6))
    file.add_geometry(np.random.default_rng(1).random((count, 3)))
    for step in range(5):
        file.add_step(float(step), {"velocity": np.full((count, 3), float(step))})
    path = write_vtkhdf(tmp_path / "fields.h5", "Triangle_6", steady=False)
    assert path.stat().st_size < 0.03 * (tmp_path / "fields.h5").stat().st_size


def test_it_points_to_no_step_that_may_go(tmp_path: Path) -> None:
    file = opened(tmp_path / "fields")
    file.tell_vtk()
    path = tmp_path / "fields.vtkhdf"
    assert not path.exists()  # there is no step
    file.add_step(0.0, fields_at(0.0))
    file.tell_vtk()
    assert path.exists()
    file.resume(0.0)
    assert not path.exists()


def test_a_damaged_series_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "fields.h5").write_text("nothing")
    with pytest.raises(OutputError, match=r"fields\.vtkhdf"):
        write_vtkhdf(tmp_path / "fields.h5", "Triangle_6", steady=True)
    assert [path.name for path in tmp_path.iterdir()] == ["fields.h5"]
