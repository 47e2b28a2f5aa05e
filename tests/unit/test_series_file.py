"""The XDMF file beside the HDF5 file: whole after every step, written once, open to other programs."""

import struct
import zlib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import h5py
import meshio
import numpy as np
import pytest

from incipient.errors import OutputError
from incipient.output.series_file import SeriesFile, read_step, times
from incipient.tables import hdf5

# Two quadratic triangles that share a side, which is curved.
POINTS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0, 0), (1, 0.5, 0), (0.4, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0)],
    dtype=float,
)  # fmt: skip
CELLS = np.array([(0, 1, 2, 4, 5, 6), (0, 2, 3, 6, 7, 8)])


def fields_at(time: float) -> dict[str, np.ndarray]:
    return {"velocity": time + POINTS, "pressure": time * POINTS[:, 0]}


def opened(stem: Path, steady: bool = False) -> SeriesFile:
    file = SeriesFile(stem, "Triangle_6", steady)
    file.create()
    file.add_mesh(CELLS)
    file.add_geometry(POINTS)
    return file


def listed_times(stem: Path) -> list[float]:
    tree = ElementTree.parse(stem.with_suffix(".xdmf"))
    return [float(time.get("Value", "nan")) for time in tree.iter("Time")]


def test_a_steady_flow_is_one_grid_that_meshio_reads(tmp_path: Path) -> None:
    opened(tmp_path / "fields", steady=True).add_step(0.0, fields_at(2.0))
    mesh = meshio.read(tmp_path / "fields.xdmf")
    assert np.array_equal(mesh.points, POINTS)
    (block,) = mesh.cells
    assert block.type == "triangle6" and np.array_equal(block.data, CELLS)
    assert set(mesh.point_data) == {"velocity", "pressure"}
    assert np.array_equal(mesh.point_data["velocity"], 2.0 + POINTS)


def test_a_series_lists_its_times_from_the_first_step_on(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    file = opened(tmp_path / "fields")
    for number in range(3):
        file.add_step(0.25 * number, fields_at(number))
        expected = [0.25 * n for n in range(number + 1)]
        assert listed_times(tmp_path / "fields") == expected
        assert list(pyvista.get_reader(str(tmp_path / "fields.xdmf")).time_values) == expected


def test_a_step_is_put_behind_the_others_without_writing_them_again(tmp_path: Path) -> None:
    path, file = tmp_path / "fields.xdmf", opened(tmp_path / "fields")
    file.add_step(0.0, fields_at(0.0))
    inode, sizes = path.stat().st_ino, [path.stat().st_size]
    for number in range(1, 9):
        before = path.read_text()
        file.add_step(0.5 * number, fields_at(number))
        text = path.read_text()
        kept = before[: before.rindex("    </Grid>")]
        assert text.startswith(kept) and path.stat().st_ino == inode
        sizes.append(path.stat().st_size)
    assert len(set(np.diff(sizes))) == 1
    SeriesFile(tmp_path / "fields", "Triangle_6").resume(100.0)  # writes the whole anew
    assert path.read_text() == text


@pytest.mark.parametrize("left", ["part", "nothing"])
def test_a_damaged_xdmf_file_is_made_whole_by_the_next_step(tmp_path: Path, left: str) -> None:
    path, file = tmp_path / "fields.xdmf", opened(tmp_path / "fields")
    for number in range(3):
        file.add_step(number, fields_at(number))
    path.write_bytes(path.read_bytes()[:-300]) if left == "part" else path.unlink()
    file.add_step(3.0, fields_at(3.0))
    assert listed_times(tmp_path / "fields") == times(tmp_path / "fields") == [0.0, 1.0, 2.0, 3.0]


def test_a_step_that_was_not_written_to_its_end_is_dropped(tmp_path: Path) -> None:
    file = opened(tmp_path / "fields")
    for number in range(2):
        file.add_step(number, fields_at(number))
    with h5py.File(tmp_path / "fields.h5", "r+") as stored:
        stored["step2/velocity"] = POINTS
    again = SeriesFile(tmp_path / "fields", "Triangle_6")
    again.resume(5.0)
    again.add_mesh(CELLS)
    again.add_geometry(POINTS)
    again.add_step(2.0, fields_at(2.0))
    assert listed_times(tmp_path / "fields") == times(tmp_path / "fields") == [0.0, 1.0, 2.0]


class Killed(BaseException):
    """Stands for a SIGKILL: nothing that tidies up is run after it."""


def files_of(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def put_back(directory: Path, files: dict[str, bytes]) -> None:
    for path in directory.iterdir():
        path.unlink()
    for name, content in files.items():
        (directory / name).write_bytes(content)


def test_a_writer_killed_at_any_of_its_writes_leaves_a_whole_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the third step: before, between and after all changes of the file; the first two steps are always there."""
    series = opened(tmp_path / "f")
    for time in (0.5, 1.0):
        series.add_step(time, fields_at(time))
    before, write, left = files_of(tmp_path), hdf5._write_at, [0]

    def write_until_killed(*arguments: Any) -> None:
        if left[0] == 0:
            raise Killed
        left[0] -= 1
        write(*arguments)

    monkeypatch.setattr(hdf5, "_write_at", write_until_killed)
    for allowed in range(200):
        left[0], ended = allowed, False
        try:
            series.add_step(1.5, fields_at(1.5))
            ended = True
        except Killed:
            pass
        monkeypatch.setattr(hdf5, "_write_at", write)
        found = times(tmp_path / "f")
        assert found in ([0.5, 1.0], [0.5, 1.0, 1.5]) and (not ended or len(found) == 3)
        assert set(read_step(tmp_path / "f", 1).fields) == set(fields_at(1.0))
        if ended:
            break
        put_back(tmp_path, before)
        series = opened_again(tmp_path / "f", 1.0)
        monkeypatch.setattr(hdf5, "_write_at", write_until_killed)
    assert ended and allowed > 10
    assert not (tmp_path / "f.h5.journal").exists()


def test_half_a_journal_counts_as_none(tmp_path: Path) -> None:
    series = opened(tmp_path / "f")
    series.add_step(0.5, fields_at(0.5))
    (tmp_path / "f.h5.journal").write_bytes(b"\x00" * 11)
    assert times(tmp_path / "f") == [0.5]
    assert (tmp_path / "f.h5.journal").exists()  # who reads leaves all as it is
    series.add_step(1.0, fields_at(1.0))
    assert times(tmp_path / "f") == [0.5, 1.0]
    assert not (tmp_path / "f.h5.journal").exists()


def test_a_journal_is_read_and_not_carried_out(tmp_path: Path, monkeypatch: Any) -> None:
    """A step whose journal is whole is there for a reader, who changes no byte of a directory that may be another's."""
    series = opened(tmp_path / "f")
    series.add_step(0.5, fields_at(0.5))
    monkeypatch.setattr("incipient.tables.hdf5.complete", lambda path: None)  # killed there
    series.add_step(1.0, fields_at(1.0))
    before = files_of(tmp_path)
    assert "f.h5.journal" in before and times(tmp_path / "f") == [0.5, 1.0]
    np.testing.assert_array_equal(
        read_step(tmp_path / "f").fields["velocity"], fields_at(1.0)["velocity"]
    )
    assert files_of(tmp_path) == before


def test_a_forged_journal_writes_nothing(tmp_path: Path) -> None:
    """Neither reading nor writing follows a link with which a directory of somebody else names a file of the user."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "f.h5").symlink_to(victim)
    changes = struct.pack("<QQ", 3, 1) + struct.pack("<QQ", 0, 3) + b"bad"
    journal = zlib.crc32(changes).to_bytes(4, "big") + changes
    (tmp_path / "out" / "f.h5.journal").write_bytes(journal)
    with pytest.raises(OutputError, match=r"f\.h5: cannot be read"):
        times(tmp_path / "out" / "f")
    with pytest.raises(OSError, match="symbolic links"):
        hdf5.complete(tmp_path / "out" / "f.h5")
    assert victim.read_text() == "precious"


def opened_again(stem: Path, time: float) -> SeriesFile:
    series = SeriesFile(stem, "Triangle_6")
    series.resume(time)
    series.add_mesh(CELLS)
    series.add_geometry(POINTS)
    return series
