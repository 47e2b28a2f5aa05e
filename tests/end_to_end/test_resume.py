"""A run that was cut short and resumed ends where the whole run ends, with the same files."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import Session
from mpi4py import MPI
from processes import VORTEX_STREET, overrides, result_of, settings
from scenes import rows_of

import incipient
from incipient.errors import ConvergenceError, Interrupted, MeshError
from incipient.fluid import Fluid
from incipient.fluid.newton import NewtonReport
from incipient.interrupt import Interruption
from incipient.output.series_file import read_step, times
from incipient.restart import VERSION, read
from incipient.scene.file import loads

COMM = MPI.COMM_SELF
# The pebble of the pothole on a coarse mesh, which it wears out at t = 0.8 and 1.1, with a checkpoint at 1.0.
POTHOLE = """\
title = "pothole"
[domain]
kind = "box"
length = 40.0
height = 40.0
[fluid]
reynolds = 40.0
scale = "flow"
[flow]
kind = "lid"
velocity = 40.0
[body]
shape = "ellipse"
semi_axes = [2.0, 1.0]
centre = [20.0, 20.0]
motion = "free"
mass = 251.3
inertia = 314.2
[time]
end = 1.3
step = 0.1
[numerics]
mesh_size = 4.0
remesh_below = 0.9
tolerance = 1e-9
error_bars = false
[output]
every = 1
checkpoint = 10
"""
# Adaptive steps about a disc that stands still.
VORTICES = [
    *overrides(
        numerics_order=2, numerics_mesh_size=4, time_step=0.01, time_end=0.3, time_tolerance=1e-2
    ),
    *overrides(numerics_error_bars=False, numerics_tolerance=1e-9, output_every=3),
]
# Lengths of adaptive steps follow a third difference of the flow, which is known to its tolerance of 1e-9 only.
ADAPTIVE = 1e-6
# How iterations went is not the trajectory: after resuming the first step's factors are new.
OF_ITERATIONS = ("newton", "interface", "interface_residual")

# Columns that are compared with the size of another; components of a vector are with that of all.
LIKE = {"y": "x", "slip": "velocity", "lift": "drag"}


# -- what must be the same ---------------------------------------------------------------------------------------


def history(directory: Path) -> dict[str, list[Any]]:
    rows = rows_of(directory / "history.csv")
    return {name: [row[name] or "nan" for row in rows] for name in rows[0]}


def assert_same_columns(
    computed: Mapping[str, Any], expected: Mapping[str, Any], names: Iterable[str], rel: float
) -> None:
    """Numbers by name, relative to the largest of their kind."""
    without_axis = {name: re.sub(r"_[wxyz\d]$", "", name) for name in names}
    kinds = {name: LIKE.get(kind, kind) for name, kind in without_axis.items()}
    pairs = {name: np.array([computed[name], expected[name]], dtype=float) for name in names}
    for name, (one, other) in pairs.items():
        alike = [pair[1] for other_name, pair in pairs.items() if kinds[other_name] == kinds[name]]
        # An error of a step is a third difference, of which round-off is a larger share.
        scale = (1e3 if name == "error" else 1.0) * rel * np.nanmax(np.abs(alike))
        assert one == pytest.approx(other, abs=scale, nan_ok=True), name


def assert_same_run(computed: Path, expected: Path, rel: float = 1e-8) -> None:
    """The same rows, the same fields at the same times on the same meshes, the same end; every file readable."""
    one, other = history(computed), history(expected)
    assert list(one) == list(other)
    assert_same_columns(one, other, set(one) - {*OF_ITERATIONS, "mode"}, rel)
    for stem in ("fields", "surface"):
        assert_same_series(computed / stem, expected / stem, rel)
    for numbers in (result_of(computed), result_of(expected)):
        assert numbers["status"] == "complete"
        assert numbers["cost"]["iterations"]["steps"] == len(one["time"])


def assert_same_series(computed: Path, expected: Path, rel: float) -> None:
    assert times(computed) == pytest.approx(times(expected), rel=rel)
    for index in range(len(times(expected))):
        one, other = read_step(computed, index), read_step(expected, index)
        assert one.cells.shape == other.cells.shape
        # Several ranks number the nodes in another order.
        mine, theirs = (np.lexsort(np.round(step.points, 6).T) for step in (one, other))
        assert one.points[mine] == pytest.approx(other.points[theirs], abs=1e-7)
        for name, values in other.fields.items():
            scale = 100 * rel * np.abs(values).max()
            assert one.fields[name][mine] == pytest.approx(values[theirs], abs=scale), (name, index)


# -- whole runs and cut ones -------------------------------------------------------------------------------------


def pothole(**values: object) -> incipient.Scene:
    return loads(POTHOLE, overrides=overrides(**values))


def vortices(**values: object) -> incipient.Scene:
    return incipient.load(VORTEX_STREET, [*VORTICES, *overrides(**values)])


@pytest.fixture(scope="module")
def whole_pothole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run from the start to the end; its checkpoint is three steps old. Not to be written to."""
    directory = tmp_path_factory.mktemp("pothole")
    assert incipient.run(pothole(), directory).trajectory["remeshings"]
    return directory


@pytest.fixture(scope="module")
def whole_vortices(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run from the start to the end, without a checkpoint."""
    directory = tmp_path_factory.mktemp("vortices")
    incipient.run(vortices(), directory)
    return directory


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """`stopped(5)`: from now on runs are asked to stop in their fifth step."""

    def stop(number: int) -> None:
        asked = iter([*[False] * (number - 1), True])
        monkeypatch.setattr(Interruption, "asked", lambda self: next(asked, False))

    return stop


def copy_of(directory: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(directory, tmp_path / "copy"))


# -- the same trajectory -----------------------------------------------------------------------------------------


def test_a_grain_goes_on_through_a_new_mesh(whole_pothole: Path, tmp_path: Path) -> None:
    """What came after the checkpoint is dropped and computed again; a mesh is behind, a mesh ahead."""
    directory = copy_of(whole_pothole, tmp_path)
    assert read(directory / "checkpoint.h5", COMM).time == pytest.approx(1.0)
    result = incipient.resume(directory)
    assert [one["time"] for one in result.trajectory["remeshings"]] == pytest.approx([0.8, 1.1])
    assert_same_run(directory, whole_pothole)


def test_steps_solved_to_a_share_of_their_error_are_taken_again(tmp_path: Path) -> None:
    """From a checkpoint both go on without factors, and with the error by which the next step's tolerance goes."""
    settings_of_both = {"numerics_tolerance": "auto", "time_end": 1.2}
    incipient.run(pothole(**settings_of_both), tmp_path / "whole")
    directory = Path(shutil.copytree(tmp_path / "whole", tmp_path / "copy"))
    assert read(directory / "checkpoint.h5", COMM).progress["error"] > 1e-5
    incipient.resume(directory)
    assert_same_run(directory, tmp_path / "whole")


def test_adaptive_steps_about_a_grain_at_rest(
    whole_vortices: Path, tmp_path: Path, stopped: Callable[[int], None]
) -> None:
    """Stopped twice: right after the first step, and later. In the end no checkpoint is left."""
    stopped(1)
    with pytest.raises(Interrupted):
        incipient.run(vortices(), tmp_path)
    stopped(9)
    with pytest.raises(Interrupted):
        incipient.resume(tmp_path)
    assert len(history(tmp_path)["time"]) == 10
    incipient.resume(tmp_path)
    assert_same_run(tmp_path, whole_vortices, ADAPTIVE)
    assert not (tmp_path / "checkpoint.h5").exists()


def test_a_run_killed_between_its_last_step_and_its_result_is_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the checkpoint before, whose later steps are taken again: loads of a step need its past."""

    def killed(*arguments: object) -> None:
        raise SystemExit

    directory, scene = tmp_path / "x", pothole(output_checkpoint=4, time_end=1.2)
    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr("incipient.accuracy.finish.outcome", killed)
        incipient.run(scene, directory)
    assert read(directory / "checkpoint.h5", COMM).time == pytest.approx(0.8)
    resumed, whole = incipient.resume(directory), incipient.run(scene, tmp_path / "whole")
    assert read(directory / "checkpoint.h5", COMM).time == pytest.approx(1.2)
    assert resumed.force.flow == pytest.approx(whole.force.flow, rel=1e-7)
    assert_same_run(directory, tmp_path / "whole")


def test_a_run_goes_on_with_other_steps(tmp_path: Path, stopped: Callable[[int], None]) -> None:
    """Of a new length from the first on; with a tolerance from the length at hand on."""
    scene = vortices(time_end=0.1, fluid_reynolds=50)  # so that no step from rest is halved
    fixed = scene.model_copy(update={"time": scene.time.model_copy(update={"tolerance": None})})
    stopped(3)
    with pytest.raises(Interrupted):
        incipient.run(fixed, tmp_path)
    stopped(4)
    with pytest.raises(Interrupted):
        incipient.resume(tmp_path, ["time.step=0.005"])
    incipient.resume(tmp_path, ["time.tolerance=10"])
    lengths = [float(length) for length in history(tmp_path)["step"]]
    assert lengths[:8] == pytest.approx([*3 * [0.01], *5 * [0.005]])
    assert lengths[8] > 0.009


def test_the_number_of_ranks_may_change(
    whole_pothole: Path, tmp_path: Path, session: Session
) -> None:
    """From one to two, and from two to one."""
    (tmp_path / "pothole.toml").write_text(POTHOLE)
    shutil.copytree(whole_pothole, tmp_path / "one_to_two")
    cut = ["run", "pothole.toml", *settings(time_end=1.0), "--out", "two_to_one"]
    for outcome in session(2, [["resume", "one_to_two"], cut], timeout=300):
        assert outcome.codes == [0, 0], outcome.lines
    incipient.resume(tmp_path / "two_to_one", ["time.end=1.3"])
    for name in ("one_to_two", "two_to_one"):
        assert_same_run(tmp_path / name, whole_pothole)


# -- failures ----------------------------------------------------------------------------------------------------


def test_a_step_that_does_not_converge_leaves_a_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = Fluid.solve

    def failing(self: Fluid, *arguments: Any, **options: Any) -> NewtonReport:
        if self.time > 0.45:
            self.state.x.array[:] = np.nan
            return NewtonReport(False, (1.0,), np.inf)
        return solve(self, *arguments, **options)

    with monkeypatch.context() as patch, pytest.raises(ConvergenceError) as told:
        patch.setattr(Fluid, "solve", failing)
        incipient.run(pothole(), tmp_path)
    # Halved steps come up to t = 0.45, of which the last must be short.
    assert str(told.value).endswith(f" is saved: incipient resume {tmp_path}") and "\n" not in str(
        told.value
    )
    failed = result_of(tmp_path)
    assert failed["status"] == "failed" and failed["error"] == str(told.value)
    kept = read(tmp_path / "checkpoint.h5", COMM)
    assert kept.time == pytest.approx(float(history(tmp_path)["time"][-1]), rel=1e-12)
    assert incipient.resume(tmp_path).status == "complete"


def test_a_mesh_that_cannot_be_made_leaves_a_checkpoint(
    whole_pothole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The state right before the new mesh is kept: with a way to make it the run goes on as it would have."""

    def failing(*arguments: object) -> None:
        raise MeshError("the geometry could not be meshed: no reason")

    with (
        monkeypatch.context() as patch,
        pytest.raises(MeshError, match=r"t = 0\.8 is saved: incipient resume"),
    ):
        patch.setattr("incipient.coupled.remeshing.carry_over", failing)
        incipient.run(pothole(), tmp_path)
    incipient.resume(tmp_path)
    assert_same_run(tmp_path, whole_pothole)


# -- what is kept ----------------------------------------------------------------------------------------------


def test_fields_that_cannot_be_read_do_not_stop_it(whole_pothole: Path, tmp_path: Path) -> None:
    """A series of which the first step is cut in half, and one that is gone; see also test_series_file."""
    directory = copy_of(whole_pothole, tmp_path)
    os.truncate(directory / "fields" / "000000.h5", 5_000)
    shutil.rmtree(directory / "surface")
    assert incipient.resume(directory).status == "complete"
    assert history(directory)["time"] == history(whole_pothole)["time"]
    assert times(directory / "fields")[-3:] == pytest.approx([1.1, 1.2, 1.3])
    assert times(directory / "surface") == pytest.approx([1.1, 1.2, 1.3])
    assert (directory / "fields" / "000000.h5.1").stat().st_size == 5_000


def test_a_resumed_run_that_does_not_end_keeps_the_complete_result(
    whole_pothole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stopped: Callable[[int], None],
) -> None:
    """Interrupted, and failed."""
    directory = copy_of(whole_pothole, tmp_path)
    stopped(1)
    with pytest.raises(Interrupted):
        incipient.resume(directory)
    assert result_of(directory) == result_of(whole_pothole)
    monkeypatch.setattr(
        Fluid, "solve", lambda self, *arguments, **options: NewtonReport(False, (1.0,), np.inf)
    )
    with pytest.raises(ConvergenceError):
        incipient.resume(directory)
    assert result_of(directory)["status"] == "failed"
    assert json.loads((directory / "result.json.1").read_text()) == result_of(whole_pothole)


def test_a_run_that_can_be_resumed_is_moved_before_another(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    directory = tmp_path / "x"
    first, second = vortices(time_end=0.02, output_checkpoint=1), vortices(time_end=0.01)
    incipient.run(first, directory)
    (directory / "notes.txt").write_text("mine")
    before = {path.name for path in directory.iterdir()} - {"notes.txt"}
    incipient.run(second, directory)
    (told,) = [record.getMessage() for record in caplog.records]
    assert (
        told
        == f"{directory}: the earlier run there, which can be resumed, is now in {tmp_path / 'x.1'}"
    )
    assert {path.name for path in (tmp_path / "x.1").iterdir()} == before
    assert (directory / "notes.txt").exists() and result_of(directory)["scene"]["time"][
        "end"
    ] == 0.01
    assert incipient.resume(tmp_path / "x.1", ["time.end=0.03"]).status == "complete"
    # It is removed where that is asked for, and one that cannot be resumed in any case.
    incipient.run(second, tmp_path / "x.1", overwrite=True)
    incipient.run(second, directory)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x", "x.1"]


# -- what is refused ---------------------------------------------------------------------------------------------


def test_refusals_are_one_line_on_all_ranks(
    whole_pothole: Path, tmp_path: Path, session: Session
) -> None:
    names = ("version", "history", "good")
    for name in names:
        shutil.copytree(whole_pothole, tmp_path / name)
    with h5py.File(tmp_path / "version/checkpoint.h5", "r+") as file:
        file.attrs["version"] = VERSION + 1
    os.truncate(tmp_path / "history/history.csv", 1000)
    other = ["resume", "good", "--set", "body.mass=1"]
    outcomes = session(2, [*(["resume", name] for name in ("absent", *names[:-1])), other])
    told = [
        (2, "absent: there is no such directory; give the directory that a run was written to"),
        (
            5,
            f"version/checkpoint.h5: is a checkpoint of version {VERSION + 1}, this program reads version {VERSION}; "
            "resume with",
        ),
        (5, "history/history.csv: has lost some of its 10 rows; restore the file, or start a new"),
        (
            2,
            "good/scene.toml: body.mass is 1.0, but the run to resume has 251.3; keep that value (only time.end, ",
        ),
    ]
    for outcome, (code, start) in zip(outcomes, told, strict=True):
        assert outcome.codes == [code, code], outcome.lines
        assert outcome.complaint.startswith(start)
    for name in names:
        assert result_of(tmp_path / name) == result_of(whole_pothole)
    assert history(tmp_path / "good") == history(whole_pothole)
