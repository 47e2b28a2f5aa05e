"""What runs would replace in a directory: only what runs have written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from incipient.errors import OutputError
from incipient.files import write_text_atomically
from incipient.output.ownership import refuse_foreign
from incipient.scene import example, loads
from incipient.scene.file import dumps

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
    with pytest.raises(
        OutputError, match=f"{name}: is not of an incipient run.* choose another directory"
    ):
        refuse_foreign(tmp_path)
    assert (tmp_path / name).read_text() == FOREIGN[name]


def test_what_runs_wrote_is_theirs(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(dumps(loads(example())))
    (tmp_path / "history.csv").write_text("time,step,newton,error\n")
    held = dict.fromkeys(("schema_version", "status", "scene", "plan", "cost"))
    for name in ("result.json", "result.json.1"):
        (tmp_path / name).write_text(json.dumps(held))
    for name in ("fields.h5", "fields.xdmf", "flow.png", "checkpoint.h5", "checkpoint.h5.part"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "notes.txt").write_text("of the user")
    before = sorted(tmp_path.iterdir())
    refuse_foreign(tmp_path)
    assert sorted(tmp_path.iterdir()) == before  # nothing is refused, and nothing is removed yet


@pytest.mark.parametrize("name", ["result.json", "result.json.part", "fields.h5"])
def test_nothing_is_written_through_links(tmp_path: Path, name: str) -> None:
    target = tmp_path / "elsewhere"
    target.write_text("precious")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(target)
    with pytest.raises(OutputError, match=f"{name}: is a link"):
        refuse_foreign(tmp_path / "out")
    write_text_atomically(tmp_path / "out" / "result.json", "{}")
    assert target.read_text() == "precious"


def test_a_directory_that_is_not_there_is_no_one_s(tmp_path: Path) -> None:
    refuse_foreign(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()
