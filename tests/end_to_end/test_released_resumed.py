"""A grain that rolls out of its pocket, cut short and resumed, on one rank and on two: the same run."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from conftest import Session
from processes import SCENES, result_of, settings
from test_resume import assert_same_run, history

import incipient
from incipient.errors import Interrupted
from incipient.interrupt import Interruption
from incipient.scene import load

COARSE = settings(
    numerics_mesh_size=2.5, numerics_tolerance=1e-9, numerics_interface_tolerance=1e-9
)
# Fifteen steps: the last checkpoint is before the end.
SCENE = [*COARSE, *settings(time_step=0.1, time_end=1.5, output_every=5, output_checkpoint=4)]
CUT = 8  # steps, in the middle of the gust, among meshes


def released() -> incipient.Scene:
    """The demo on coarse cells, halfway out of the pocket."""
    return load(SCENES / "leaving_pocket.toml", [one for one in SCENE if one != "--set"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole run: the grain rests, rolls and slides, on several meshes."""
    directory = tmp_path_factory.mktemp("whole")
    incipient.run(released(), directory)
    found = history(directory)
    assert {"rest", "rolling"} <= set(found["mode"]) and float(found["meshes"][-1]) > 1
    assert (
        len(found["time"]) == 15
    )  # no step is repeated, as two were where the flow answered for what contacts do
    return directory


def same(found: Path, expected: Path, rel: float) -> None:
    """The same run, in which the grain does the same."""
    assert_same_run(found, expected, rel)
    assert history(found)["mode"] == history(expected)["mode"]
    one, other = (result_of(path)["trajectory"]["on_bed"] for path in (found, expected))
    assert one["first_motion"] == other["first_motion"]
    assert one["works"] == pytest.approx(other["works"], rel=1e3 * rel, abs=1e3 * rel)


@pytest.mark.slow
def test_a_released_grain_that_was_stopped_on_its_way(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = iter([*[False] * (CUT - 1), True])
    with monkeypatch.context() as patch, pytest.raises(Interrupted):
        patch.setattr(Interruption, "asked", lambda self: next(asked, False))
        incipient.run(released(), tmp_path)
    assert len(history(tmp_path)["time"]) < len(history(whole)["time"])
    incipient.resume(tmp_path)
    same(tmp_path, whole, 1e-6)


@pytest.mark.slow
def test_a_released_grain_on_two_ranks_as_on_one(
    whole: Path, tmp_path: Path, session: Session
) -> None:
    """From the start, and resumed from what one rank has left."""
    shutil.copytree(whole, tmp_path / "resumed")
    run = ["run", SCENES / "leaving_pocket.toml", *SCENE, "--out", "ranks"]
    for outcome in session(2, [run, ["resume", "resumed"]], timeout=600):
        assert outcome.codes == [0, 0], outcome.lines
    for name in ("ranks", "resumed"):
        same(tmp_path / name, whole, 1e-5)
