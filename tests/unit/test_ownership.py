"""What commands may replace in a directory, and who may work there: only their own files, one run at a time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from environment import environment
from matplotlib.figure import Figure
from mpi4py import MPI

import incipient
from incipient.cli import main
from incipient.errors import OutputError
from incipient.files import MARK, append_row, own, owned, write_text_atomically
from incipient.output.ownership import locked, make_room, place_scene, refuse_foreign
from incipient.pictures import style
from incipient.results.kinds import GUSTS
from incipient.scene import example, loads
from incipient.scene.file import dumps
from incipient.sweep.store import Store
from incipient.sweep.table import write_parquet

FOREIGN = {
    "result.json": json.dumps({"status": "complete", "energy": 3.0}),
    "history.csv": "time,energy\n0,1\n",
    "fields.xdmf": "numbers",
    "report.html": "<html>quarterly figures</html>",
    "checkpoint.h5": "something else",
    "scene.toml": example(),
}
COMM = MPI.COMM_SELF


# -- files of others -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOREIGN)
def test_what_others_wrote_is_refused_and_stays(tmp_path: Path, name: str) -> None:
    """Also in a directory where incipient has written other files."""
    write_text_atomically(tmp_path / "threshold.json", "{}")
    (tmp_path / name).write_text(FOREIGN[name])
    refused = f"{name}: was not written by incipient; choose another directory"
    with pytest.raises(OutputError, match=refused), locked(tmp_path, COMM):
        pass
    with pytest.raises(OutputError, match=refused):
        write_text_atomically(tmp_path / name, "ours")
    with pytest.raises(OutputError, match=refused):
        append_row(tmp_path / name, {"time": 0.0})
    assert (tmp_path / name).read_text() == FOREIGN[name]


def test_a_folder_of_others_is_refused(tmp_path: Path) -> None:
    (tmp_path / "fields").mkdir()
    refused = pytest.raises(OutputError, match="fields: was not written by incipient")
    with refused, locked(tmp_path, COMM):
        pass


def test_a_run_that_makes_room_leaves_files_of_others(tmp_path: Path) -> None:
    """Beside its files, within its folder of fields, and where a mark of somebody else names them."""
    (tmp_path / "precious").write_text("mine")
    out = tmp_path / "out"
    (out / "fields").mkdir(parents=True)
    for path in (out / "result.json", out / "fields" / "000000.h5"):
        write_text_atomically(path, "ours")
    own(out / "fields")
    for path in (out / "notes.txt", out / "fields" / "notes.txt"):
        path.write_text("mine")
    with (out / "fields" / MARK).open("a") as mark:
        mark.write("../../precious\n")
    make_room(out, overwrite=True)
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"precious", f"out/{MARK}", "out/notes.txt", "out/fields/notes.txt"}


def test_results_of_another_scene_make_room(tmp_path: Path) -> None:
    """A search of gusts beside a run that can be resumed: the run moves with its scene, and can be resumed there."""
    directory = tmp_path / "x"
    directory.mkdir()
    of_run, of_gusts = dumps(loads(example())), dumps(loads(example(in_space=True)))
    place_scene(directory, of_run)
    for name in ("checkpoint.h5", "gusts.json"):
        write_text_atomically(directory / name, name)
    place_scene(directory, of_run, GUSTS.files)  # of one scene all may be in one place
    assert (directory / "checkpoint.h5").exists()
    place_scene(directory, of_gusts, GUSTS.files)
    assert (directory / "scene.toml").read_text() == of_gusts
    assert {path.name for path in directory.iterdir()} == {MARK, "scene.toml", "gusts.json"}
    assert (tmp_path / "x.1" / "scene.toml").read_text() == of_run
    assert (tmp_path / "x.1" / "checkpoint.h5").read_text() == "checkpoint.h5"
    refuse_foreign(tmp_path / "x.1")


@pytest.mark.parametrize("name", ["result.json", "result.json.part", "fields", MARK])
def test_nothing_is_written_through_links(tmp_path: Path, name: str) -> None:
    target, out = tmp_path / "elsewhere", tmp_path / "out"
    target.write_text("precious")
    out.mkdir()
    (out / name).symlink_to(target)
    with pytest.raises(OutputError, match=f"{name}: is a link"), locked(out, COMM):
        pass
    with suppress(OutputError):  # half a file of an earlier call is removed
        write_text_atomically(out / "result.json", "{}")
    with suppress(OutputError):
        append_row(out / name, {"time": 0.0})
    assert target.read_text() == "precious"


def test_a_mark_that_is_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / MARK)
    with pytest.raises(OutputError, match=MARK), locked(tmp_path, COMM):
        pass


def test_a_survey_beside_its_bed_leaves_the_bed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bed.toml").write_text('[bed]\nkind = "spheres"\nfile = "spheres.csv"\n[flow]\n')
    (tmp_path / "spheres.csv").write_text("0,0,0,1\n")
    assert main(["survey", "bed.toml", "--out", "."]) == 5
    assert "spheres.csv: was not written by incipient" in capsys.readouterr().err
    own(tmp_path / "spheres.csv")  # that of an earlier survey
    assert main(["survey", "bed.toml", "--out", "."]) == 5
    assert "spheres.csv: is read and would be replaced" in capsys.readouterr().err
    assert (tmp_path / "spheres.csv").read_text() == "0,0,0,1\n"


def test_the_file_of_a_sweep_is_no_target(tmp_path: Path) -> None:
    with Store(tmp_path / "s.sqlite", make=True):
        pass
    before = (tmp_path / "s.sqlite").read_bytes()
    for write in (incipient.report, write_parquet):
        with pytest.raises(OutputError, match=r"s\.sqlite: is not a valid name for this file"):
            write(tmp_path / "s.sqlite", tmp_path / "s.sqlite")
    assert (tmp_path / "s.sqlite").read_bytes() == before


def test_who_reads_makes_nothing(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(OutputError, match=r"notes\.txt: is not the file of a sweep"):
        Store(tmp_path / "notes.txt")
    refuse_foreign(tmp_path / "nothing")
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert not (tmp_path / "notes.txt").stat().st_size


def test_pictures_are_not_drawn_through_links(tmp_path: Path) -> None:
    (tmp_path / "victim").write_text("precious")
    (tmp_path / "flow.png").symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match=r"flow\.png: is a link"):
        style.save(Figure(), tmp_path / "flow.png")
    assert (tmp_path / "victim").read_text() == "precious"


# -- one run at a time -----------------------------------------------------------------------------------------

# Takes the lock of a directory, says so, and keeps it until its standard input ends.
KEEPER = """
import sys
from pathlib import Path
from mpi4py import MPI
from incipient.output.ownership import locked
with locked(Path(sys.argv[1]), MPI.COMM_SELF):
    print("taken", flush=True)
    sys.stdin.read()
"""
RANKS = """
import sys
from pathlib import Path
from mpi4py import MPI
from incipient.errors import OutputError
from incipient.output.ownership import locked
try:
    with locked(Path(sys.argv[1]), MPI.COMM_WORLD):
        pass
except OutputError as error:
    print(f"{MPI.COMM_WORLD.rank}: {error}\\n", end="")
"""


def test_a_second_run_is_refused_until_the_first_has_ended_however_it_ends(
    tmp_path: Path, mpirun: Any
) -> None:
    """On all ranks, naming the process at work; a killed one, though a zombie, holds nothing."""
    keeper = subprocess.Popen(
        [sys.executable, "-c", KEEPER, str(tmp_path)],
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert keeper.stdout is not None and keeper.stdout.readline() == "taken\n"
    done = mpirun(2, RANKS, tmp_path, timeout=60)
    assert done.returncode == 0, done.stderr
    first, second = sorted(done.stdout.splitlines())
    assert first[:2] == "0:" and second[:2] == "1:" and first[2:] == second[2:]
    assert f"{tmp_path}: another run is using it (process {keeper.pid} on " in first
    assert first.endswith("); wait for it or choose another directory")
    keeper.kill()
    os.waitid(os.P_PID, keeper.pid, os.WEXITED | os.WNOWAIT)
    refused = pytest.raises(OutputError, match=f"process {os.getpid()} on")
    with locked(tmp_path, COMM), refused, locked(tmp_path, COMM):
        raise AssertionError("two at once")
    keeper.communicate()


@pytest.mark.parametrize("kind", [OutputError, ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_the_lock_goes_with_an_error(tmp_path: Path, kind: type[BaseException]) -> None:
    for _ in range(2):
        with pytest.raises(kind), locked(tmp_path / "new", COMM, make=True):
            raise kind
    assert owned(tmp_path / "new") == set()


def test_a_missing_directory_is_named(tmp_path: Path) -> None:
    absent = pytest.raises(OutputError, match=r"absent: no such directory; give")
    with absent, locked(tmp_path / "absent", COMM):
        pass
