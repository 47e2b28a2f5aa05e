"""`incipient cost` and what `incipient plan` says before and after it, by real runs of a coarse grain on a bed.

No test here depends on how long anything takes but the slow one, which compares processor times.
"""

from __future__ import annotations

import csv
import json
import math
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from environment import end, environment
from processes import CAVITY, CYLINDER, GRAIN_ON_BED, SCENES, settings

from incipient.cli import main
from incipient.files import write_text_atomically
from incipient.scene import load, save

COARSE = settings(
    numerics_mesh_size=2.5, contact_gap=0.05, domain_length=12.0, domain_height=6.0, body_x=4.0
)


def calibrated_in(directory: Path) -> dict[str, str]:
    """Variables for a calibration in a directory; compiled forms stay where they are."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    made = directory / "cache"
    made.mkdir(exist_ok=True)
    (cache / "fenics").mkdir(parents=True, exist_ok=True)
    if not (made / "fenics").exists():
        (made / "fenics").symlink_to(cache / "fenics")
    return {"XDG_CACHE_HOME": str(made)}


@pytest.fixture
def predicted(capsys: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """`predicted(scene, variables, *options)`: what `plan` predicts, with a calibration of its own."""

    def predict(scene: Path, variables: dict[str, str], *options: str) -> Any:
        capsys.readouterr()
        with monkeypatch.context() as surroundings:
            for name, value in variables.items():
                surroundings.setenv(name, value)
            assert main(["plan", str(scene), "--json", *options]) == 0
        return json.loads(capsys.readouterr().out)["prediction"]

    return predict


@pytest.mark.slow
def test_cost_of_a_coarse_grain_on_a_bed(command: Any, predicted: Any, tmp_path: Path) -> None:
    out, variables = tmp_path / "study", calibrated_in(tmp_path)
    shipped = predicted(GRAIN_ON_BED, variables, *COARSE)
    assert shipped["factor"] == 3.0 and not shipped["own"] and shipped["cpu"] > 0.5
    arguments = ("cost", GRAIN_ON_BED, "--quick", "--out", out, *COARSE)
    interrupted(arguments, out, variables)
    first = (out / "cost.csv").read_text()
    done = command(*arguments, timeout=200, **variables)
    assert done.returncode == 0, done.stderr
    assert "each further digit" in done.stdout or "too few" in done.stdout

    assert (out / "cost.csv").read_text().startswith(first), (
        "what was made before the interruption is kept"
    )
    rows = list(csv.DictReader((out / "cost.csv").open()))
    assert [(row["order"], row["failed"]) for row in rows] == [(o, "") for o in "22334"]
    stored = json.loads((out / "cost.json").read_text())
    errors = {(run["order"], run["mesh_size"]): run["error"] for run in stored["runs"]}
    assert max(errors.values()) < 0.2
    assert min(errors.values()) == min(e for (order, _), e in errors.items() if order == 3)
    assert all(run["peak_mib"] > 50 and run["cpu"] > 0 for run in stored["runs"])
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    # Whether these few runs suffice for a law hangs on the times measured.
    assert ("| accuracy |" in (out / "cost.md").read_text()) == (
        "each further digit" in done.stdout
    )

    plan = predicted(GRAIN_ON_BED, variables, *COARSE)
    assert plan["own"] and plan["factor"] == 1.4
    assert set(plan["errors"]) >= {"force", "couple"}
    elsewhere = {"XDG_CACHE_HOME": str(tmp_path / "none")}
    given = predicted(GRAIN_ON_BED, elsewhere, "--study", str(out), *COARSE)
    assert given == {**plan, "source": f"by runs of this scene in {out}"}

    before = (out / "cost.csv").read_bytes()
    again = command(*arguments, timeout=60, **variables)
    assert again.returncode == 0, again.stderr
    assert " of 5:" not in again.stderr, "no run is made again"
    assert (out / "cost.csv").read_bytes() == before

    # Another algebra changes nothing that counts: in one run more beside one that is there, as its reference is.
    rung = ("--orders", 3, "--sizes", repr(2**0.5), "--solvers", "chords")
    by_chords = command(
        "cost", GRAIN_ON_BED, *rung, "--out", out, *COARSE, timeout=100, **variables
    )
    assert by_chords.returncode == 0, by_chords.stderr
    rows = list(csv.DictReader((out / "cost.csv").open()))
    assert [row["failed"] for row in rows if row["solver"] == "chords"] == [""]
    assert_ways_are_told(("chords",), out, by_chords.stdout, 1e-5)


def interrupted(arguments: tuple[object, ...], out: Path, variables: dict[str, str]) -> None:
    """Stop the command after the first of its runs; no run goes on without it."""
    words = [sys.executable, "-m", "incipient", *map(str, arguments)]
    process = subprocess.Popen(
        words,
        env=environment() | variables,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    rows, began = out / "cost.csv", time.monotonic()
    while not rows.exists() and process.poll() is None and time.monotonic() - began < 100:
        time.sleep(0.05)
    process.terminate()
    try:
        _, said = process.communicate(timeout=30)
    finally:
        end(process)
    assert process.returncode == 130, said
    assert said.splitlines()[-1] == "incipient: interrupted; what was computed so far is kept"


@pytest.mark.slow
def test_cost_in_space(command: Any, predicted: Any, tmp_path: Path) -> None:
    """Two coarse runs of order three and a reference of order four; then `plan` knows what it did not know before."""
    out, variables = tmp_path / "study", calibrated_in(tmp_path)
    size = settings(domain_length=12.0, domain_width=12.0, domain_height=6.0, body_x=6.0)
    coarse = [*size, *settings(numerics_mesh_size=3.0, contact_gap=0.05)]
    scene = SCENES / "sphere_on_plane.toml"
    before = command("plan", scene, *coarse, **variables)
    assert before.returncode == 0 and "after `incipient cost SCENE`" in before.stdout
    done = command("cost", scene, "--quick", "--out", out, *coarse, timeout=600, **variables)
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((out / "cost.csv").open()))
    assert [(row["order"], row["failed"]) for row in rows] == [("3", ""), ("3", ""), ("4", "")]
    plan = predicted(scene, variables, *coarse)
    assert plan["own"] and plan["cpu"] > 0.5
    # Force of the exact solution for an endless shear (Goldman, Cox & Brenner 1967): 1.63 x 3 pi mu G x 0.55.
    force = float(rows[-1]["force_x"])
    assert force == pytest.approx(1.6325438 * 6.0 * math.pi * 0.5 * 0.55, rel=0.05)


IN_TIME = (
    '[domain]\nlength=8\nheight=4\n[fluid]\nreynolds=20\nscale="grain"\n[flow]\nkind="uniform"\n'
    '[body]\nshape="disc"\ndiameter=1\ncentre=[3.0, 2.0]\n[time]\nend=0.8\nstep=0.1\nstart="stokes"\n'
    "[numerics]\nmesh_size=2.5\n"
)


@pytest.mark.slow
def test_ways_to_solve_in_time(command: Any, tmp_path: Path) -> None:
    """Linearisation and scheme change the loads a little."""
    ways, out, scene = ("extrapolated", "bdf1"), tmp_path / "study", tmp_path / "stream.toml"
    scene.write_text(IN_TIME)
    ladder = ["--orders", 2, "--sizes", 1, "--steps", 1, "--solvers", *ways]
    done = command("cost", scene, *ladder, "--out", out, timeout=200, **calibrated_in(tmp_path))
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((out / "cost.csv").open()))
    assert [(row["solver"], row["failed"]) for row in rows] == [
        (way, "") for way in ("", *ways, "")
    ]
    assert_ways_are_told(ways, out, done.stdout, 0.05)


def assert_ways_are_told(ways: tuple[str, ...], out: Path, said: str, small: float) -> None:
    """Of runs that were solved in other ways, how much that changes; in files and in words."""
    stored = json.loads((out / "cost.json").read_text())
    changes = {one["solver"]: one["change"] for one in stored["solvers"]}
    assert set(changes) == set(ways)
    assert all(0.0 < change < small for change in changes.values()), changes
    assert all(f"solver              {way}: time x " in said for way in ways)
    page = (out / "cost.md").read_text()
    assert all(f"\n| {way} | " in page and f", {way} | " in page for way in ways)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--orders", "7"], "--orders: the velocity has order 2, 3 or 4"),
        (["--steps", "2"], "--steps: the scene is steady; leave it out"),
        (
            ["--solvers", "magic"],
            "--solvers: magic is not known; give some of: own, chords, loose, umfpack, ",
        ),
        (
            ["--solvers", "bdf1"],
            "--solvers: bdf1 changes nothing in this scene; give some of: own, chords, ",
        ),
        (["--sizes", "0"], "--sizes: give positive numbers, such as 2 1.4 1"),
        (["--sizes", "x"], "argument --sizes: invalid float value: 'x'; see incipient cost --help"),
        (["--set", "fluid.reynolds=-1"], "--set fluid.reynolds=-1: fluid.reynolds: "),
    ],
)
def test_bad_input_is_one_line(capsys: Any, tmp_path: Path, options: list[str], said: str) -> None:
    assert main(["cost", str(GRAIN_ON_BED), "--out", str(tmp_path / "study"), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"incipient: {said}")


def test_the_directory_of_another_scene(command: Any, tmp_path: Path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    save(load(CAVITY), study / "scene.toml")
    write_text_atomically(study / "cost.csv", "order,mesh_size\n")
    done = command("cost", GRAIN_ON_BED, "--out", study)
    assert done.returncode == 5
    assert "holds the runs of another scene" in done.stderr


def test_ranks_are_refused(command: Any) -> None:
    done = command("cost", GRAIN_ON_BED, ranks=2)
    assert done.returncode == 2
    assert "call it without mpirun" in done.stderr


# -- predictions against runs: processor times, which other processes disturb less than wall times ------------------

DEMOS = {
    "grain_on_bed": (GRAIN_ON_BED, []),
    "cylinder": (CYLINDER, []),
    "cavity": (CAVITY, []),
    # Shorter than the demos, with steps as long: what is predicted is in proportion to their number.
    "vortex_street": (SCENES / "vortex_street.toml", settings(time_end=1.0)),
    "pulsating": (SCENES / "pulsating.toml", settings(time_end=0.25)),
    "pothole": (SCENES / "pothole_4.toml", settings(time_end=1.0)),
}


@pytest.mark.slow
def test_plan_predicts_the_demos_within_a_factor_two(
    command: Any, predicted: Any, tmp_path: Path
) -> None:
    """From the built-in calibration alone, which none of the demos but the grain on a bed is part of."""
    variables = calibrated_in(tmp_path)
    done = command("calibrate", timeout=900, **variables)
    assert done.returncode == 0, done.stderr
    found = {}
    for name, (scene, options) in DEMOS.items():
        plan = predicted(scene, variables, *options)
        for turn in range(2):  # the first compiles
            cpu = spent(lambda s=scene, o=options, t=turn: run(command, s, tmp_path / f"run{t}", o))
        found[name] = (plan["cpu"], cpu)
    ratios = {name: told / taken for name, (told, taken) in found.items()}
    assert all(0.5 <= ratio <= 2.0 for ratio in ratios.values()), (ratios, found)


def run(command: Any, scene: Path, out: Path, options: list[str]) -> None:
    done = command("run", scene, "--out", out, *options, timeout=900)
    assert done.returncode == 0, done.stderr


def spent(work: Any) -> float:
    """Processor time of the processes that something starts."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)
