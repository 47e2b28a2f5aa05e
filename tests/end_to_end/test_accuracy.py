"""Requested accuracies, and what accuracy costs."""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment import end, environment
from mpi4py import MPI
from processes import CAVITY, GRAIN_ON_BED, SCENES, settings
from scenes import IN_STREAM
from scipy.special import kve

import incipient
from incipient.accuracy import searches
from incipient.accuracy.coarse_runs import changed
from incipient.accuracy.first_mesh import first_mesh
from incipient.cli import main
from incipient.cost.frontier import seconds
from incipient.errors import ConvergenceError
from incipient.results.errorbars import Loads
from incipient.results.result import Result
from incipient.scene import Scene, load, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.state import Run

# Asking for accuracy: what is promised is kept, at a price that is worth it, and no further than asked.


DEMOS = Path(__file__).parents[2] / "demos" / "scenes"
# Drag and lift of DFG 2D-1 over V^2 L/2 = 0.2^2 0.1/2: G. Nabh, On high order methods for the stationary
# incompressible Navier-Stokes equations, Heidelberg 1998.
CYLINDER = np.array([5.57953523384, 0.010618948146]) * 0.5 * 0.2**2 * 0.1
# Of the example scene: cells of a quarter of the default size, elements of order four (docs/contribute/defaults.md).
ON_BED = np.array([1.354864, 0.718549])
COUPLE_ON_BED = -0.1787733
# Unknowns and relative errors of the force of uniformly refined meshes of the example (docs/contribute/defaults.md).
UNIFORM = {2: (6577, 1.8e-4), 3: (9550, 1.1e-4)}
QUIET = {"error_bars": False}
POCKET = {"kind": "half-discs", "radius": 0.5, "spacing": 1.2, "offset": 1.0}
STREAM = (
    IN_STREAM
    + """
[time]
end = 0.8
step = 0.1
start = "stokes"
[output]
fields = false
[numerics]
mesh_size = 2.0
error_bars = false
"""
)
# The walls are 17 widths of the layer that the disc's turning to and fro carries along away.
TURNED = """
[domain]
kind = "box"
length = 8.0
height = 8.0
origin = [-4.0, -4.0]
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "still"
velocity = 1.0
[body]
shape = "disc"
diameter = 1.0
centre = [0.0, 0.0]
motion = "prescribed"
course = ["0", "0", "sin(2*t)"]
[time]
end = 4.0
step = 0.05
[numerics]
accuracy_of = "torque"
error_bars = false
[output]
fields = false
"""
SCRIPT = """
import sys, json
from mpi4py import MPI
import incipient
scene = incipient.load(sys.argv[1], ["numerics.accuracy=0.003", "numerics.error_bars=false"])
result = incipient.run(scene, sys.argv[2])
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([result.force.flow.tolist(), [trial.unknowns for trial in result.adaptation.trials]]))
"""


def cylinder(**numerics: Any) -> Scene:
    return changed(load(DEMOS / "cylinder.toml"), numerics={"order": 2, **QUIET, **numerics})


def on_bed(**numerics: Any) -> Scene:
    return changed(grain_on_bed(), numerics={**QUIET, **numerics})


def in_pocket(gravity: float, **numerics: Any) -> Scene:
    """A disc between two half-discs; its safety factor is 0.581 times gravity."""
    return changed(on_bed(**numerics), gravity={"acceleration": gravity}, bed=POCKET)


def in_small_pocket(gravity: float, **numerics: Any) -> Scene:
    """The same grain with the sides and the top of the domain nearer, which takes fewer cells."""
    near = {"domain": {"length": 12.0, "height": 6.0}, "body": {"x": 4.0}}
    return changed(in_pocket(gravity, **numerics), **near)


def run(scene: Scene, directory: Path | None = None) -> Result:
    return incipient.run(scene, directory, MPI.COMM_SELF)


def error_of(result: Result, reference: np.ndarray) -> float:
    assert result.force is not None
    return float(np.linalg.norm(result.force.flow[:2] - reference) / np.linalg.norm(reference))


@pytest.mark.parametrize("accuracy", [pytest.param(0.01, marks=pytest.mark.slow), 0.001])
@pytest.mark.parametrize(("scene", "reference"), [(cylinder, CYLINDER), (on_bed, ON_BED)])
def test_what_is_asked_for_is_reached_and_not_much_more(
    scene: Any, reference: np.ndarray, accuracy: float
) -> None:
    result = run(scene(accuracy=accuracy))
    found, true = result.adaptation, error_of(result, reference)
    assert found is not None and found.met and found.reason == "reached"
    assert found.trials[0].unknowns == first_mesh(scene(accuracy=accuracy)).unknowns, (
        "as the plan says"
    )
    assert accuracy / 20.0 < true < accuracy
    # On a first, coarse mesh, which is enough for a hundredth, the estimate is a sixth below the error of a cylinder.
    assert found.reached == pytest.approx(true, rel=0.1 if accuracy < 0.01 else 0.25)
    assert found.reached == found.trials[-1].estimate
    assert result.gap is None or result.gap.resolved


def test_couple() -> None:
    result = run(on_bed(accuracy=0.001, accuracy_of="torque"))
    assert result.torque is not None and result.adaptation is not None and result.adaptation.met
    assert abs(result.torque.flow[2] / COUPLE_ON_BED - 1.0) < 0.001


def test_adapted_meshes_beat_uniform_refinement() -> None:
    """With fewer unknowns the error is less than half of that on meshes refined everywhere, in either order."""
    result = run(on_bed(accuracy=2e-4))
    true, unknowns = error_of(result, ON_BED), result.cost["unknowns"]
    for order, (many, error) in UNIFORM.items():
        assert true < 0.5 * error and unknowns < 0.9 * many, (order, unknowns, true)


def test_safety_factor() -> None:
    result = run(in_small_pocket(2.0, accuracy=0.002, accuracy_of="safety factor"))
    finer = run(in_small_pocket(2.0, accuracy=0.0005, accuracy_of="safety factor"))
    assert result.adaptation is not None and result.adaptation.met
    assert finer.adaptation is not None and finer.adaptation.met
    # The interval goes both ways from the value.
    assert result.verdict["safety_factor"] == pytest.approx(
        finer.verdict["safety_factor"], rel=0.002
    )
    assert len(result.adaptation.trials) <= len(finer.adaptation.trials)


def test_budget_of_time_stops(tmp_path: Path) -> None:
    result = run(on_bed(accuracy=1e-5, budget_seconds=1e-3), tmp_path)
    stored = json.loads((tmp_path / "result.json").read_text())["adaptation"]
    assert result.adaptation is not None and not result.adaptation.met
    assert len(result.adaptation.trials) == 1
    assert "numerics.budget_seconds = 0.001: the next mesh would take about" in stored["reason"]
    assert stored["met"] is False
    # On the first, coarse mesh the estimate is a sixth below the error.
    assert stored["reached"] == pytest.approx(error_of(result, ON_BED), rel=0.25)
    assert stored["reason"] in result.text()


def test_budget_of_memory_stops() -> None:
    result = run(on_bed(accuracy=1e-5, budget_mib=1.0))
    assert result.adaptation is not None and len(result.adaptation.trials) == 1
    assert "numerics.budget_mib = 1: the next mesh would need about" in result.adaptation.reason


def test_verdict_stops_when_it_is_decided(tmp_path: Path) -> None:
    """Far from one the first mesh decides; the asked scene is kept as it was."""
    scene = in_small_pocket(10.0, accuracy="verdict", error_bars=True)
    result = run(scene, tmp_path)
    assert result.adaptation is not None and result.adaptation.reason == "the verdict is certain"
    assert len(result.adaptation.trials) == 1
    assert result.error_bars is not None and result.error_bars.safety is not None
    assert result.error_bars.safety.certain
    assert load(tmp_path / "scene.toml").numerics == scene.numerics


@pytest.mark.slow
def test_verdict_acts_on_what_decides() -> None:
    """Where sides that are too near decide, they are moved away; a budget ends that."""
    result = run(in_small_pocket(1.78, accuracy="verdict", error_bars=True))
    assert result.adaptation is not None and result.adaptation.met
    assert any(trial.note.endswith("of the domain") for trial in result.adaptation.trials)
    assert result.scene["domain"]["length"] > 12.0
    assert result.error_bars is not None and result.error_bars.safety is not None
    assert result.error_bars.safety.certain


def test_flow_in_time(tmp_path: Path) -> None:
    """A disc in a stream that starts: steps and mesh are made finer as each errs; the last run is recorded."""
    result = run(loads(STREAM + "accuracy=0.001\n"), tmp_path)
    fine = run(
        loads(STREAM + "order=3\n", overrides=("time.step=0.0125", "numerics.mesh_size=1.0"))
    )
    found = result.adaptation
    assert found is not None and found.met and found.reached is not None
    assert result.force is not None and fine.force is not None
    true = np.linalg.norm(result.force.flow - fine.force.flow) / np.linalg.norm(fine.force.flow)
    assert true < 0.001
    assert found.trials[0].unknowns == first_mesh(loads(STREAM + "accuracy=0.001\n")).unknowns
    for trial in found.trials:
        assert (
            trial.estimate is not None and trial.of_step is not None and trial.of_mesh is not None
        )
        assert trial.estimate <= trial.of_step + trial.of_mesh
    history = (tmp_path / "history.csv").read_text().splitlines()
    assert found.trials[-1].step is not None
    assert len(history) == 1 + round(0.8 / found.trials[-1].step)
    written = json.loads((tmp_path / "result.json").read_text())["adaptation"]
    assert written["reason"] == "reached"
    assert written["trials"][-1]["of_step"] == found.trials[-1].of_step
    assert f"of the step {found.trials[-1].of_step:.1e}, of the mesh" in found.lines()[-1]


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.01, pytest.param(1e-4, marks=pytest.mark.slow)])
def test_a_disc_that_is_turned_in_fluid_at_rest(accuracy: float) -> None:
    """Against the exact couple: the moving grain's load is as accurate as asked for, and steps are refined for it."""
    result = run(loads(TURNED, overrides=(f"numerics.accuracy={accuracy}",)))
    exact = couple_on_a_turned_disc(4.0, viscosity=0.05, radius=0.5, frequency=2.0)
    found = result.adaptation
    assert (
        result.torque is not None and found is not None and found.met and found.reached is not None
    )
    error = abs(result.torque.flow[2] / exact - 1.0)
    assert error < accuracy
    assert 0.5 < found.reached / error < 3.0
    first, last = found.trials[0], found.trials[-1]
    assert first.step is not None and last.step is not None
    assert last.step < 0.5 * first.step and last.cells < 2.0 * first.cells, (
        "the time errs most by far"
    )


def couple_on_a_turned_disc(
    time: float, viscosity: float, radius: float, frequency: float
) -> float:
    """The couple on a disc that turns with spin sin(frequency t) in endless fluid, at rest at first.

    The flow is v(r) K1(l r)/K1(l R) around the disc in Laplace's space, l = sqrt(s/viscosity), also of the full
    equations, whose convective term the pressure balances. Inverted on Talbot's contour, as in J. Abate and P. P.
    Valko, Int. J. Numer. Methods Eng. 60, 979 (2004).
    """
    terms = 30
    angle = np.arange(1, terms) * np.pi / terms
    scale = 2.0 * terms / (5.0 * time)
    cotangent = 1.0 / np.tan(angle)
    s = np.append(scale, scale * angle * (cotangent + 1j))
    weights = np.append(0.5, 1.0 + 1j * (angle * (1.0 + cotangent**2) - cotangent))
    reach = radius * np.sqrt(s / viscosity)
    spins = frequency / (s**2 + frequency**2)
    values = spins * (reach * kve(0, reach) / kve(1, reach) + 2.0)
    summed = float(np.sum((weights * np.exp(s * time) * values).real)) * scale / terms
    return -2.0 * np.pi * viscosity * radius**2 * summed


def test_a_comparison_that_fails_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a coarser run cannot be made steps and cells are halved, and it goes on."""
    loads_of, failures = searches.loads_of, [1]

    def fail_at_first(scene: Scene, comm: MPI.Comm) -> Loads:
        failures[0] -= 1
        if failures[0] == 0:
            raise ConvergenceError("no step was accepted")
        return loads_of(scene, comm)

    monkeypatch.setattr(searches, "loads_of", fail_at_first)
    found = run(loads(STREAM + "accuracy=0.01\n")).adaptation
    assert found is not None and found.met
    first, second = found.trials[:2]
    assert (first.estimate, first.note) == (
        None,
        "not compared: no step was accepted, in a run for comparison",
    )
    assert (first.step, second.step) == (0.1, 0.05)
    assert second.note == "" and second.unknowns > first.unknowns


def test_a_budget_stops_flow_in_time(tmp_path: Path) -> None:
    """What is recorded is the last run that it allows."""
    result = run(loads(STREAM + "accuracy=1e-5\nbudget_seconds=0.01\n"), tmp_path)
    found = result.adaptation
    assert found is not None and not found.met and found.reached is not None
    assert found.reason.startswith(
        "stopped at numerics.budget_seconds = 0.01: the next mesh would take about"
    )
    assert len(found.trials) == 1
    assert json.loads((tmp_path / "result.json").read_text())["status"] == "complete"


@pytest.mark.slow
def test_two_ranks_choose_alike(tmp_path: Path, mpirun: Any) -> None:
    path = tmp_path / "grain.toml"
    path.write_text(commented(grain_on_bed()))
    done = mpirun(2, SCRIPT, path, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    force, unknowns = json.loads(done.stdout.splitlines()[-1])
    alone = run(on_bed(accuracy=0.003))
    assert alone.adaptation is not None
    assert unknowns == pytest.approx(
        [trial.unknowns for trial in alone.adaptation.trials], rel=0.05
    )
    assert np.linalg.norm(np.array(force[:2]) - ON_BED) / np.linalg.norm(ON_BED) < 0.003


def test_without_an_accuracy_nothing_changes() -> None:
    result = run(on_bed(mesh_size=2.0))
    assert result.adaptation is None
    assert result.to_dict()["adaptation"] is None


def test_a_mesh_too_coarse_to_solve_on_is_refined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where Newton's method fails on the first mesh the next is finer; three failures are an error."""
    solve, failures = searches.loads_at, [2]

    def fail_at_first(of: Run, factor: float) -> Any:
        failures[0] -= 1
        if failures[0] >= 0:
            raise ConvergenceError("no steady flow found")
        return solve(of, factor)

    monkeypatch.setattr(searches, "loads_at", fail_at_first)
    found = run(on_bed(accuracy=0.01)).adaptation
    assert found is not None and found.met
    assert [trial.note for trial in found.trials] == [
        "no steady flow found",
        "no steady flow found",
        "",
    ]
    failures[0] = 3
    with pytest.raises(ConvergenceError, match="no steady flow found"):
        run(on_bed(accuracy=0.01))


def test_the_best_is_kept_where_a_later_mesh_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    solve, calls = searches.loads_at, [0]

    def fail_at_second(of: Run, factor: float) -> Any:
        calls[0] += 1
        if calls[0] == 2:
            raise ConvergenceError("no steady flow found")
        return solve(of, factor)

    monkeypatch.setattr(searches, "loads_at", fail_at_second)
    found = run(on_bed(accuracy=0.0005), tmp_path).adaptation
    assert found is not None and not found.met
    assert found.reason == "the next mesh failed: no steady flow found"
    assert found.reached == found.trials[0].estimate
    assert json.loads((tmp_path / "result.json").read_text())["status"] == "complete"


# `incipient cost` by real runs: of a coarse grain on a bed, in 3-D, of a threshold; and what `incipient plan` prints.
#
# No test here depends on how long anything takes.


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
