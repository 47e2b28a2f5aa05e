"""Series of fields, a file for each step: open to VTK after every step, whole after a kill, on a full disk, damaged."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from environment import environment

from incipient.output.series_file import SeriesFile, Unreadable, read_step, times

# Two quadratic triangles that share a side, which is curved.
POINTS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0, 0), (1, 0.5, 0), (0.4, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0)],
    dtype=float,
)  # fmt: skip
CELLS = np.array([(0, 1, 2, 4, 5, 6), (0, 2, 3, 6, 7, 8)], dtype=np.int32)
MESH = {"topology": CELLS, "geometry": POINTS}


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
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(f"{stem}.xdmf")
    for moment in reader.time_values:
        reader.set_active_time_value(moment)
        grid = reader.read()
        grid = grid[0] if isinstance(grid, pyvista.MultiBlock) else grid
        assert np.array_equal(grid.cell_connectivity.reshape(-1, 6), CELLS)
        for name, values in fields_at(moment).items():
            assert np.array_equal(grid[name], values)
    return list(reader.time_values)


def test_vtk_shows_all_steps_after_each(tmp_path: Path) -> None:
    """From the first one on, which is all that there is of a steady flow."""
    file = written(tmp_path / "fields", 1)
    assert shown(tmp_path / "fields") == [0.0]
    for number in (1, 2):
        file.add_step(number, fields_at(number), {})
        assert shown(tmp_path / "fields") == times(tmp_path / "fields") == [*range(number + 1)]
    with h5py.File(tmp_path / "fields" / "000002.h5") as step:
        files = [step.get(name, getlink=True).filename for name in ("topology", "geometry")]
    assert files == ["000000.h5"] * 2  # a mesh is stored once


WRITER = """
import sys
from pathlib import Path
from test_series_file import written
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
            [sys.executable, "-c", WRITER, str(stem)],
            env=environment() | {"PYTHONPATH": f"{here}:{Path(here).parent}"},
            stdout=subprocess.PIPE,
        )
        assert writer.stdout is not None and writer.stdout.readline() == b"begun\n"
        while not stem.with_suffix(".xdmf").exists():  # the first step may take long to begin
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, 0.3))
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
        found = times(stem)
        assert found == [*range(len(found))]
        for index in (0, -1):
            step = read_step(stem, index)
            assert np.array_equal(step.fields["velocity"], fields_at(step.time)["velocity"])
        assert len(shown(stem)) in (len(found), len(found) - 1)
        again = SeriesFile(stem, "Triangle_6")
        again.begin(after=found[-1] / 2)
        again.add_step(1e6, fields_at(1e6), MESH)
        kept = [one for one in found if one <= found[-1] / 2]
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
    with pytest.raises(Unreadable, match=r"000001\.h5: cannot be read: it is damaged or incomp"):
        read_step(stem, 1)
    path.write_bytes(content[:2000])
    SeriesFile(stem, "Triangle_6").begin(after=2.0)
    assert shown(stem) == times(stem) == [0.0, 2.0]
    assert (stem / "000001.h5.1").read_bytes() == content[:2000]
    (told,) = [record.getMessage() for record in caplog.records]
    assert told.endswith(f"it is damaged or incomplete; it is now {stem / '000001.h5.1'}")


def test_a_series_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(Unreadable, match=r"fields: holds no fields; run the scene with output\.f"):
        times(tmp_path / "fields")
