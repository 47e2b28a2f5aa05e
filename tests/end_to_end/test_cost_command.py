"""`incipient cost` by real runs: of a coarse grain on a bed, in 3-D, of a threshold; and what `incipient plan` prints.

No test here depends on how long anything takes.
"""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from environment import end, environment
from processes import CAVITY, GRAIN_ON_BED, SCENES, settings

from incipient.cli import main
from incipient.cost.frontier import seconds

COARSE = settings(
    numerics_mesh_size=2.5, contact_gap=0.05, domain_length=12.0, domain_height=6.0, body_x=4.0
)


def rows_of(out: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((out / "cost.csv").open()))


@pytest.mark.slow
def test_cost_of_a_coarse_grain_on_a_bed(command: Any, tmp_path: Path) -> None:
    """Interrupted after its first run and resumed; the finest cells err least; what is there is not run again."""
    out = tmp_path / "study"
    arguments = ("cost", GRAIN_ON_BED, "--quick", "--out", out, *COARSE)
    interrupted(arguments, out)
    first = json.loads((out / "cost.json").read_text())["runs"]
    done = command(*arguments, timeout=200)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("As the scene stands (P3-P2, mesh_size 2.5) a run takes ")
    assert "; ten times less error (" in done.stdout
    stored = json.loads((out / "cost.json").read_text())
    assert stored["runs"][: len(first)] == first, "what was made before the interruption is kept"
    assert [run["rung"]["order"] for run in stored["runs"]] == [3, 3, 3, 3]
    assert all(run["peak_mib"] > 50 and run["cpu"] > 0 for run in stored["runs"])
    errors = {row["mesh_size"]: row["errors"]["force"] for row in stored["judged"]}
    assert min(errors, key=errors.get) == min(errors) and max(errors.values()) < 0.2
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    again = command(*arguments, timeout=60)
    assert again.returncode == 0 and " of 4:" not in again.stderr
    assert again.stdout == done.stdout


def interrupted(arguments: tuple[object, ...], out: Path) -> None:
    """Stop the command after the first of its runs; no run goes on without it."""
    words = [sys.executable, "-m", "incipient", *map(str, arguments)]
    streams = {"stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(words, env=environment(), start_new_session=True, **streams)
    kept, began = out / "cost.json", time.monotonic()
    while not kept.exists() and process.poll() is None and time.monotonic() - began < 100:
        time.sleep(0.05)
    process.terminate()
    try:
        _, said = process.communicate(timeout=30)
    finally:
        end(process)
    assert process.returncode == 130, said
    assert said.splitlines()[-1] == "incipient: interrupted; what was computed so far is kept"


@pytest.mark.slow
def test_cost_in_3d_against_an_exact_force(command: Any, tmp_path: Path) -> None:
    """In an endless shear 6 pi mu r^2 G (1 + e) f, f = 1.6325 (Goldman, Cox & Brenner 1967): the domain errs by 5%."""
    out, force = tmp_path / "study", 1.6325438 * 6.0 * math.pi * 0.5 * 0.55
    size = settings(domain_length=12.0, domain_width=12.0, domain_height=6.0, body_x=6.0)
    coarse = [*size, *settings(numerics_mesh_size=3.0, contact_gap=0.05)]
    arguments = ("cost", SCENES / "sphere_on_plane.toml", "--sizes", 1, "--out", out, *coarse)
    done = command(*arguments, "--exact", f"force_x={force}", timeout=600)
    assert done.returncode == 0, done.stderr
    assert "reference: exact values" in done.stdout
    rows = rows_of(out)
    assert {row["order"] for row in rows} == {"3"} and len(rows) == 2
    for row in rows:
        assert float(row["error"]) == pytest.approx(abs(float(row["force_x"]) / force - 1.0))
        assert float(row["error"]) < 0.05


@pytest.mark.slow
def test_cost_of_a_threshold(command: Any, tmp_path: Path) -> None:
    out = tmp_path / "study"
    size = settings(numerics_mesh_size=3.0, contact_gap=0.05)
    scene = SCENES / "pocket_in_gusts.toml"
    rungs = ("--orders", 3, "--sizes", 1)
    done = command("cost", scene, "--do", "threshold", *rungs, "--out", out, *size, timeout=200)
    assert done.returncode == 0, done.stderr
    plain = settings(numerics_error_bars=False)
    single = command("threshold", scene, "--out", tmp_path / "single", *size, *plain, timeout=200)
    assert single.returncode == 0, single.stderr
    own = next(row for row in rows_of(out) if (row["order"], row["mesh_size"]) == ("3", "3.0"))
    known = json.loads((tmp_path / "single" / "threshold.json").read_text())
    assert float(own["critical_flow"]) == pytest.approx(known["factor"], rel=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--orders", "7"], "--orders: the velocity has order 2, 3 or 4"),
        (["--steps", "2"], "--steps: the scene is steady; leave it out"),
        (["--sizes", "0"], "--sizes: give positive numbers, such as 2 1.4 1"),
        (["--sizes", "x"], "argument --sizes: invalid float value: 'x'; see incipient cost --help"),
        (["--exact", "force_x"], "--exact force_x: give NAME=VALUE ..."),
        (["--set", "fluid.reynolds=-1"], "--set fluid.reynolds=-1: fluid.reynolds: "),
    ],
)
def test_bad_input_is_one_line(capsys: Any, tmp_path: Path, options: list[str], said: str) -> None:
    assert main(["cost", str(GRAIN_ON_BED), "--out", str(tmp_path / "study"), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"incipient: {said}")


def test_a_retired_command_says_what_to_do(capsys: Any) -> None:
    assert main(["calibrate"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("incipient: calibrate: is retired; `incipient cost SCENE`")


def test_ranks_are_refused(command: Any) -> None:
    done = command("cost", GRAIN_ON_BED, ranks=2)
    assert done.returncode == 2
    assert "call it without mpirun" in done.stderr


def test_a_plan_says_the_time_by_runs_of_its_kind(
    capsys: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scaled by the unknowns; other kinds of runs and damaged results say nothing."""
    monkeypatch.chdir(tmp_path)

    def planned(*overrides: str) -> list[str]:
        assert main(["plan", str(CAVITY), *settings(numerics_mesh_size=4), *overrides]) == 0
        lines = capsys.readouterr().out.splitlines()
        return [line.strip() for line in lines if "of wall time" in line]

    assert planned() == []
    coarse = settings(numerics_mesh_size=6)
    assert main(["run", str(CAVITY), *coarse, "--log-level", "error"]) == 0
    result = tmp_path / "results" / CAVITY.stem / "result.json"
    cost = json.loads(result.read_text())["cost"]
    capsys.readouterr()
    assert main(["plan", str(CAVITY), *settings(numerics_mesh_size=4), "--json"]) == 0
    unknowns = json.loads(capsys.readouterr().out)["estimate"]["unknowns"]
    taken = seconds(cost["wall_time"]["total"] * unknowns / cost["unknowns"])
    assert planned() == [f"about {taken} of wall time, scaled from 1 run of its kind in results"]
    assert planned(*settings(numerics_order=2)) == []
    result.write_text("{")
    assert planned() == []
