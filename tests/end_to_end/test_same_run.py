"""A run on two ranks, and one that was cut and resumed, is the whole run on one rank: a catalogue of scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Session
from processes import result_of
from scenes import SCENES
from test_free_surface import FLOATING, WAVE
from test_large_grain import stone
from test_large_grain_in_space import stone as ball_on_bed
from test_moving_grain import carried_in_a_cavity
from test_moving_in_space import through_a_new_mesh
from test_moving_stone import moving, over_waves
from test_open_channels import SHORT
from test_resume import assert_same_columns, history
from test_rough_beds import moving as over_rough_waves
from test_runs_in_space import close_to_a_plane
from test_turbulent_channels import in_short_steps

import incipient
from incipient.scene import Numerics, Scene, Time
from incipient.scene.file import dumps, loads

# The demo of a grain that leaves its pocket on coarse cells: it rests, rolls and slides, on several meshes.
LEAVING = (
    *("numerics.mesh_size=2.5", "numerics.tolerance=1e-9", "numerics.interface_tolerance=1e-9"),
    *("time.step=0.1", "time.end=1.5", "output.fields=false"),
)
FILM = (
    *("domain.symmetric=false", "time.end=0.5", "time.step=0.25", "output.fields=false"),
    *("numerics.mesh_size=4", "numerics.tolerance=1e-12", "numerics.interface_tolerance=1e-10"),
)
GRAIN = ("x", "velocity_x", "velocity_y", "force_x", "force_y", "torque", "spin", "meshes")
SURFACE = ("elevation_1", "elevation_2", "inflow", "volume_above_level", "energy_fluid")
IN_SPACE = (
    *("x", "z", "quaternion_w", "quaternion_y", "velocity_x", "velocity_z", "spin_y"),
    "meshes",
)
LOADS = ("force", "torque")


@dataclass(frozen=True)
class Case:
    """A scene, the time at which a run is cut, columns of its history and how much they may differ.

    resumed, ranks: largest differences over the largest value of a column, or of the load in steady flow; None: not run
    new_meshes: fewest in a run
    """

    scene: Callable[[], Scene]
    columns: tuple[str, ...] = ()
    cut: float = 0.0
    resumed: float | None = None
    ranks: float | None = None
    new_meshes: int = 0
    slow: bool = True


CASES = {
    "wave": Case(
        *(lambda: loads(WAVE), ("elevation_1", "elevation_2", "energy_fluid", "energy_potential")),
        *(0.2, 1e-7, 1e-9),
        slow=False,
    ),
    "disc below a wave": Case(
        *(lambda: loads(FLOATING), ("y", "velocity_y", "elevation_1", "energy_fluid", "meshes")),
        *(0.4, 1e-6, None, 1),
        slow=False,
    ),
    "channel with waves": Case(lambda: loads(SHORT), SURFACE, 0.4, 1e-8, 1e-8),
    "film over a bump, whole": Case(
        lambda: incipient.load(SCENES / "film_over_bump.toml", FILM),
        ("elevation_1", "elevation_2", "energy_fluid"),
        ranks=1e-8,
    ),
    "ellipse in a cavity": Case(
        lambda: carried_in_a_cavity(0.08, mesh_size=4.0, remesh_below=0.98),
        (*GRAIN, "energy_fluid", "dissipation"),
        ranks=1e-9,
        new_meshes=1,
    ),
    "spheroid in shear": Case(*(through_a_new_mesh, IN_SPACE, 0.75, 1e-7, 1e-9, 1)),
    "grain that leaves its pocket": Case(
        lambda: incipient.load(SCENES / "leaving_pocket.toml", LEAVING),
        *(GRAIN, 0.8, 1e-6, 1e-5, 1),
    ),
    "disc by k-omega SST": Case(
        lambda: over_waves(0.1, 0.02, "rest", 0.9995),
        ("x", "torque", "y_plus_max"),
        0.06,
        1e-10,
        None,
        3,
    ),
    "free disc by k-omega SST": Case(
        lambda: over_waves(0.1, 0.02, "rest", 0.99995, motion="free", density=0.5),
        *(GRAIN[1:5], 0.06, None, 1e-5, 3),
    ),
    "disc by k-epsilon": Case(
        lambda: moving(5e-3, 1e-3, remesh_below=0.998),
        *((*GRAIN[:5], "y_plus_max", "meshes"), 3e-3, 1e-10, 1e-6, 3),
    ),
    "free disc over rough waves by k-omega SST": Case(
        lambda: over_rough_waves("free", 0.25, 0.9995),
        ("x", "torque", "force_x", "force_y", "y_plus_max", "mesh_quality"),
        *(0.15, 1e-10, None, 3),
    ),
    "channel by k-epsilon": Case(
        *(lambda: in_short_steps(1.5), ("shear_velocity", "y_plus_min", "y_plus_max")),
        *(0.75, 1e-13),
        slow=False,
    ),
    "channel by k-omega SST": Case(
        lambda: in_short_steps(0.75, "k-omega-sst"),
        ("shear_velocity", "y_plus_min", "y_plus_max"),
        *(0.375, 1e-12),
        slow=False,
    ),
    "held disc by k-epsilon": Case(
        lambda: stone(time=Time(end=3e-3, step=2.5e-4)), ("force_x", "force_y"), 1.5e-3, 1e-12
    ),
    "steady flow past a sphere": Case(close_to_a_plane, ranks=1e-6),
    "steady flow by k-epsilon": Case(stone, ranks=1e-4),
    "steady flow by k-epsilon in 3-D": Case(
        lambda: ball_on_bed(numerics=Numerics(mesh_size=7.0, error_bars=False, tolerance=1e-9)),
        ranks=1e-8,
    ),
}


def scene_of(name: str) -> Scene:
    """The scene of a case, with a checkpoint where it is cut, at which a whole run forgets what it reuses as well."""
    scene, cut = CASES[name].scene(), CASES[name].cut
    if not cut:
        return scene
    output = scene.output.model_copy(update={"checkpoint": round(cut / scene.time.step)})
    return scene.model_copy(update={"output": output})


def cases(how: str) -> list[Any]:
    """The cases that are run in a way, `resumed` or on `ranks`."""
    chosen = (name for name, case in CASES.items() if getattr(case, how) is not None)
    return [
        pytest.param(name, marks=pytest.mark.slow) if CASES[name].slow else name for name in chosen
    ]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`whole(name)`: the directory of a case's whole run on one rank, computed once."""
    directories: dict[str, Path] = {}

    def directory_of(name: str) -> Path:
        if name not in directories:
            directories[name] = tmp_path_factory.mktemp("whole")
            incipient.run(scene_of(name), directories[name])
        return directories[name]

    return directory_of


def assert_same(name: str, directory: Path, whole: Path, tolerance: float) -> None:
    """Columns of the history and modes on a bed, or the load in steady flow; and error bars of elevations."""
    case, computed, result = CASES[name], result_of(directory), result_of(whole)
    if case.columns:
        rows, expected = history(directory), history(whole)
        assert rows.get("mode") == expected.get("mode")
    else:
        rows, expected = ({key: one[key]["flow"] for key in LOADS} for one in (computed, result))
    assert_same_columns(rows, expected, case.columns or LOADS, tolerance)
    bars = [one["error_bars"] for one in (computed, result)]
    if bars[1] is not None:
        one, other = ([part["elevation"] for part in bar["terms"][0]["parts"]] for bar in bars)
        assert np.array(one) == pytest.approx(np.array(other), rel=1e-3)
    if case.new_meshes:
        assert len(result["trajectory"]["remeshings"]) >= case.new_meshes


@pytest.mark.parametrize("name", cases("resumed"))
def test_a_resumed_run_is_the_whole_one(
    name: str, whole: Callable[[str], Path], tmp_path: Path
) -> None:
    case, scene = CASES[name], scene_of(name)
    cut = scene.time.model_copy(update={"end": case.cut})
    incipient.run(scene.model_copy(update={"time": cut}), tmp_path)
    incipient.resume(tmp_path, [f"time.end={scene.time.end!r}"])
    assert_same(name, tmp_path, whole(name), case.resumed)


@pytest.mark.parametrize("name", cases("ranks"))
def test_two_ranks_are_as_one(
    name: str, whole: Callable[[str], Path], tmp_path: Path, session: Session
) -> None:
    (tmp_path / "scene.toml").write_text(dumps(scene_of(name)), encoding="utf-8")
    (done,) = session(2, [["run", "scene.toml", "--out", "two"]], timeout=600)
    assert done.codes == [0, 0], done.lines
    assert_same(name, tmp_path / "two", whole(name), CASES[name].ranks)
