"""What commands would replace in a directory: only what they have written."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

import incipient
from incipient.cli import main
from incipient.errors import OutputError
from incipient.files import MARK, append_row, own, owned, write_text_atomically
from incipient.output.lock import locked
from incipient.output.ownership import OTHERS, place_scene, refuse_foreign
from incipient.pictures import style
from incipient.scene import example, loads
from incipient.scene.file import dumps
from incipient.sweep.store import Store
from incipient.sweep.table import write_parquet

FOREIGN = {
    "result.json": json.dumps({"status": "complete", "energy": 3.0}),
    "threshold.json": "[1, 2]",
    "history.csv": "time,energy\n0,1\n",
    "fields.h5": "numbers",
    "flow.png": "a picture",
    "report.html": "<html>quarterly figures</html>",
    "checkpoint.h5": "something else",
    "scene.toml": example(),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_others_wrote_is_refused_and_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(FOREIGN[name])
    refused = f"{name}: was not written by incipient.* choose another directory"
    with pytest.raises(OutputError, match=refused):
        refuse_foreign(tmp_path)
    with pytest.raises(OutputError, match=refused):
        write_text_atomically(tmp_path / name, "ours")
    assert (tmp_path / name).read_text() == FOREIGN[name]


def test_what_was_changed_since_is_refused(tmp_path: Path) -> None:
    """A file of the user's with the name of an earlier result; files that grow are this program's at any size."""
    write_text_atomically(tmp_path / "spheres.csv", "x,y,z,diameter\n")
    write_text_atomically(tmp_path / "spheres.csv", "x,y,z,diameter\n0,0,0,1\n")
    append_row(tmp_path / "history.csv", {"time": 0.0})
    append_row(tmp_path / "history.csv", {"time": 1.0})
    (tmp_path / "spheres.csv").write_text("x,y,z,diameter\n0,0,0,1.5\n")
    with pytest.raises(OutputError, match=r"spheres\.csv: .* has been changed"):
        write_text_atomically(tmp_path / "spheres.csv", "")
    append_row(tmp_path / "history.csv", {"time": 2.0})
    assert owned(tmp_path) == {"history.csv"}


def test_a_file_that_has_grown_is_the_users_if_it_changes_after_the_run(tmp_path: Path) -> None:
    """While a run is at work, and after it was killed, its size says nothing; at its end it is recorded."""
    for time in (0.0, 1.0):
        with locked(tmp_path, MPI.COMM_SELF, make=True):
            append_row(tmp_path / "history.csv", {"time": time})
    own(tmp_path, {"fields.h5": None})  # of a run that was killed
    (tmp_path / "fields.h5").write_text("any size")
    refuse_foreign(tmp_path)
    (tmp_path / "history.csv").write_text("time,energy\n0,1\n")
    refused = pytest.raises(OutputError, match=r"history\.csv: .*has been changed since")
    with refused, locked(tmp_path, MPI.COMM_SELF, make=True):
        pass
    assert (tmp_path / "history.csv").read_text() == "time,energy\n0,1\n"


def test_a_file_whose_next_writer_was_killed_is_still_ours(tmp_path: Path) -> None:
    """Killed after its mark was written and before the new file took the old one's place: sizes 5 there, 9 marked."""
    path = tmp_path / "surface.h5.journal"
    write_text_atomically(path, "1" * 5)
    own(tmp_path, {path.name: 9})
    assert owned(tmp_path) == {path.name}
    write_text_atomically(path, "2" * 7)
    assert path.read_text() == "2" * 7


def test_runs_of_earlier_versions_are_adopted(tmp_path: Path) -> None:
    """Their directories have no mark, but the scene as runs write it."""
    (tmp_path / "scene.toml").write_text(dumps(loads(example())))
    names = ("fields.h5", "result.json", "result.json.1", "flow.png", "checkpoint.h5.part")
    for name in (*names, "survey.png"):
        (tmp_path / name).write_bytes(b"")
    refuse_foreign(tmp_path)
    write_text_atomically(tmp_path / "result.json", "{}")
    with pytest.raises(OutputError, match=r"survey\.png: was not written"):
        write_text_atomically(tmp_path / "survey.png", "")


def test_an_edited_scene_is_the_users(tmp_path: Path) -> None:
    place_scene(tmp_path, dumps(loads(example())))
    refuse_foreign(tmp_path)
    with (tmp_path / "scene.toml").open("a") as scene:
        scene.write("# my own words\n")
    with pytest.raises(OutputError, match=r"scene\.toml: .*has been changed since"):
        refuse_foreign(tmp_path)


def test_results_of_another_scene_make_room(tmp_path: Path) -> None:
    """A search of gusts beside a run that can be resumed: the run moves with its scene, and can be resumed there."""
    directory = tmp_path / "x"
    directory.mkdir()
    of_run, of_gusts = dumps(loads(example())), dumps(loads(example(in_space=True)))
    place_scene(directory, of_run)
    for name in ("checkpoint.h5", "gusts.json"):
        write_text_atomically(directory / name, name)
    place_scene(directory, of_run, OTHERS["gusts"])  # of one scene all may be in one place
    assert (directory / "checkpoint.h5").exists()
    place_scene(directory, of_gusts, OTHERS["gusts"])
    assert (directory / "scene.toml").read_text() == of_gusts
    assert {path.name for path in directory.iterdir()} == {MARK, "scene.toml", "gusts.json"}
    assert (tmp_path / "x.1" / "scene.toml").read_text() == of_run
    assert (tmp_path / "x.1" / "checkpoint.h5").read_text() == "checkpoint.h5"
    refuse_foreign(tmp_path / "x.1")


def test_what_is_read_is_not_replaced(tmp_path: Path) -> None:
    write_text_atomically(tmp_path / "spheres.csv", "0,0,0,1\n")
    source = tmp_path / ".." / tmp_path.name / "spheres.csv"
    with pytest.raises(OutputError, match=r"spheres\.csv: is read and would be replaced"):
        refuse_foreign(tmp_path, ("spheres.csv",), [source])


@pytest.mark.parametrize("name", ["result.json", "result.json.part", "fields.h5", MARK])
def test_nothing_is_written_through_links(tmp_path: Path, name: str) -> None:
    target = tmp_path / "elsewhere"
    target.write_text("precious")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(target)
    if name != MARK:
        with pytest.raises(OutputError, match=f"{name}: is a link"):
            refuse_foreign(tmp_path / "out")
    with suppress(OutputError):  # half a file of an earlier call is removed
        write_text_atomically(tmp_path / "out" / "result.json", "{}")
    with suppress(OutputError):
        append_row(tmp_path / "out" / name, {"time": 0.0})
    assert target.read_text() == "precious"


def test_a_directory_that_is_not_there_is_no_one_s(tmp_path: Path) -> None:
    refuse_foreign(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()


def test_a_survey_beside_its_bed_leaves_the_bed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bed.toml").write_text('[bed]\nkind = "spheres"\nfile = "spheres.csv"\n[flow]\n')
    (tmp_path / "spheres.csv").write_text("0,0,0,1\n")
    assert main(["survey", "bed.toml", "--out", "."]) == 5
    assert "spheres.csv: was not written by incipient" in capsys.readouterr().err
    own(tmp_path, {"spheres.csv": None})  # that of an earlier survey
    assert main(["survey", "bed.toml", "--out", "."]) == 5
    assert "spheres.csv: is read and would be replaced" in capsys.readouterr().err
    assert (tmp_path / "spheres.csv").read_text() == "0,0,0,1\n"


def test_the_file_of_a_sweep_is_no_target(tmp_path: Path) -> None:
    with Store(tmp_path / "s.sqlite", make=True):
        pass
    before = (tmp_path / "s.sqlite").read_bytes()
    for write in (incipient.report, write_parquet):
        with pytest.raises(OutputError, match=r"s\.sqlite: is no name for this file"):
            write(tmp_path / "s.sqlite", tmp_path / "s.sqlite")
    assert (tmp_path / "s.sqlite").read_bytes() == before


def test_who_reads_makes_no_database(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(OutputError, match=r"notes\.txt: is not the file of a sweep"):
        Store(tmp_path / "notes.txt")
    assert not (tmp_path / "notes.txt").stat().st_size


def test_pictures_are_not_drawn_through_links(tmp_path: Path) -> None:
    (tmp_path / "victim").write_text("precious")
    (tmp_path / "flow.png").symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match=r"flow\.png: is a link"):
        style.save(Figure(), tmp_path / "flow.png")
    assert (tmp_path / "victim").read_text() == "precious"
