"""Requested accuracies, and what accuracy costs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from processes import CAVITY, GRAIN_ON_BED, settings
from scenes import FORCE_ON_CYLINDER, IN_STREAM, SCENES, grain_on_bed, rows_of

import incipient
from incipient.accuracy.coarse_runs import changed
from incipient.accuracy.first_mesh import first_mesh
from incipient.cli import main
from incipient.cost.frontier import seconds
from incipient.errors import ConvergenceError, SceneError
from incipient.results.errorbars import Loads
from incipient.results.result import Result
from incipient.scene import Scene, load, loads
from incipient.scene.file import example
from incipient.simulation import simulate
from incipient.simulation.simulate import loads_of

# Asking for accuracy: what is promised is kept, at a price that is worth it, and no further than asked.


# Of the example scene: cells of a quarter of the default size, elements of order four (docs/contribute/defaults.md).
ON_BED = np.array([1.354864, 0.718549])
TORQUE_ON_BED = -0.1787733
# Unknowns and relative errors of the force of uniformly refined meshes of the example (docs/contribute/defaults.md).
UNIFORM = {2: (6577, 1.8e-4), 3: (9550, 1.1e-4)}
QUIET = {"error_bars": False}
FINE = {"accuracy": None, "order": 3, "mesh_size": 1.0}
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
# The walls are 17 widths of the layer that the disc's turning to and fro carries along away. In endless fluid, at rest
# at first, the flow is v(r) K1(l r)/K1(l R) in Laplace's space, l = sqrt(s/nu), also of the full equations, whose
# convective term the pressure balances: the couple is -2 pi nu R^2 spin (l R K0(l R)/K1(l R) + 2), spin = 2/(s^2 + 4).
# Inverted on Talbot's contour with 30 terms (J. Abate and P. P. Valko, Int. J. Numer. Methods Eng. 60, 979, 2004).
COUPLE_ON_TURNED = -0.2691084  # at t = 4
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
    return changed(load(SCENES / "cylinder.toml"), numerics={"order": 2, **QUIET, **numerics})


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
    """Relative error of the force in 2-D, or of the torque if the reference has one component."""
    loads = result.force.flow[:2] if len(reference) == 2 else result.torque.flow[2:]
    return float(np.linalg.norm(loads - reference) / np.linalg.norm(reference))


@pytest.mark.parametrize("accuracy", [pytest.param(0.01, marks=pytest.mark.slow), 0.001])
@pytest.mark.parametrize(
    ("scene", "quantity", "reference"),
    [
        (cylinder, "force", FORCE_ON_CYLINDER),
        (on_bed, "force", ON_BED),
        (on_bed, "torque", np.array([TORQUE_ON_BED])),
    ],
)
def test_a_requested_accuracy_is_reached_and_not_much_more(
    scene: Any, quantity: str, reference: np.ndarray, accuracy: float
) -> None:
    """On a first, coarse mesh, which is enough for a hundredth, the estimate is a sixth below a cylinder's error."""
    whole = scene(accuracy=accuracy, accuracy_of=quantity)
    result = run(whole)
    search, true = result.adaptation, error_of(result, reference)
    assert search is not None and search.met and search.reason == "reached"
    assert search.trials[0].unknowns == first_mesh(whole).unknowns, "as the plan says"
    assert true < accuracy and search.reached == search.trials[-1].estimate
    assert result.gap is None or result.gap.resolved
    if quantity == "force":
        assert true > accuracy / 20.0
        assert search.reached == pytest.approx(true, rel=0.1 if accuracy < 0.01 else 0.25)


def test_adapted_meshes_beat_uniform_refinement() -> None:
    """With fewer unknowns the error is less than half of that on meshes refined everywhere, in either order.

    Measured: 5936 unknowns of order three, an error of 4.8e-5.
    """
    result = run(on_bed(accuracy=2e-4))
    true, unknowns = error_of(result, ON_BED), result.cost["unknowns"]
    for order, (many, error) in UNIFORM.items():
        assert true < 0.5 * error and unknowns < many, (order, unknowns, true)


def test_safety_factor() -> None:
    """The interval goes both ways from the value."""
    scenes = (in_small_pocket(2.0, accuracy=a, accuracy_of="safety factor") for a in (2e-3, 5e-4))
    result, finer = map(run, scenes)
    assert result.adaptation.met and finer.adaptation.met
    value = finer.verdict["safety_factor"]
    assert result.verdict["safety_factor"] == pytest.approx(value, rel=0.002)
    assert len(result.adaptation.trials) <= len(finer.adaptation.trials)


STOPPED = "numerics.budget_seconds = 0.001: the next mesh would take about"


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (on_bed(accuracy=1e-5, budget_seconds=1e-3), STOPPED),
        (
            on_bed(accuracy=1e-5, budget_mib=1.0),
            "numerics.budget_mib = 1: the next mesh would need",
        ),
        (loads(STREAM + "accuracy=1e-5\nbudget_seconds=0.001\n"), STOPPED),
    ],
    ids=["time", "memory", "time in time"],
)
def test_budgets_stop(tmp_path: Path, scene: Scene, why: str) -> None:
    """The last run that the budget allows is recorded."""
    result = run(scene, tmp_path)
    stored = json.loads((tmp_path / "result.json").read_text())
    search = result.adaptation
    assert search is not None and not search.met and len(search.trials) == 1
    assert stored["status"] == "complete" and stored["adaptation"]["met"] is False
    assert search.reason.startswith(f"stopped at {why}")
    assert stored["adaptation"]["reason"] == search.reason in result.text()
    if scene.time is None:  # on the first, coarse mesh the estimate is a sixth below the error
        assert stored["adaptation"]["reached"] == pytest.approx(error_of(result, ON_BED), rel=0.25)


def test_a_finer_mesh_with_too_many_cells_ends_the_search() -> None:
    """What the mesh before has shown is kept; the first mesh is refused, as without an accuracy."""
    result = run(on_bed(accuracy=1e-5, max_cells=1000))
    assert result.adaptation is not None and not result.adaptation.met
    assert result.adaptation.reason.startswith(
        "the next mesh failed: numerics.max_cells: a mesh of"
    )
    assert result.adaptation.reached == pytest.approx(error_of(result, ON_BED), rel=0.25)
    with pytest.raises(SceneError, match=r"numerics\.max_cells"):
        run(on_bed(accuracy=1e-5, max_cells=10))


def test_verdict_stops_when_it_is_decided(tmp_path: Path) -> None:
    """Far from one the first mesh decides; the asked scene is kept as it was."""
    scene = in_small_pocket(10.0, accuracy="verdict", error_bars=True)
    result = run(scene, tmp_path)
    assert result.adaptation is not None and result.adaptation.reason == "the verdict is certain"
    assert len(result.adaptation.trials) == 1
    assert result.error_bars.safety.certain
    assert load(tmp_path / "scene.toml").numerics == scene.numerics


@pytest.mark.slow
def test_verdict_acts_on_what_decides() -> None:
    """Where sides that are too near decide, they are moved away; a budget ends that."""
    result = run(in_small_pocket(1.78, accuracy="verdict", error_bars=True))
    search, bars = result.adaptation, result.error_bars
    assert search is not None and search.met
    assert any(trial.note.endswith("of the domain") for trial in search.trials)
    assert result.scene["domain"]["length"] > 12.0
    assert bars is not None and bars.safety is not None and bars.safety.certain


def test_flow_in_time(tmp_path: Path) -> None:
    """A disc in a stream that starts: steps and mesh are made finer as each errs; the last run is recorded."""
    scene = loads(STREAM + "accuracy=0.001\n")
    result = run(scene, tmp_path)
    fine = run(changed(scene, time={"step": 0.0125}, numerics=FINE))
    search = result.adaptation
    assert search is not None and search.met and search.reached is not None
    assert fine.force is not None and error_of(result, fine.force.flow[:2]) < 0.001
    assert search.trials[0].unknowns == first_mesh(scene).unknowns
    for trial in search.trials:
        parts = trial.estimate, trial.of_step, trial.of_mesh
        assert None not in parts and parts[0] <= parts[1] + parts[2]
    last = search.trials[-1]
    assert last.step is not None
    history = (tmp_path / "history.csv").read_text().splitlines()
    assert len(history) == 1 + round(0.8 / last.step)
    written = json.loads((tmp_path / "result.json").read_text())["adaptation"]
    assert written["reason"] == "reached" and written["trials"][-1]["of_step"] == last.of_step
    assert f"of the step {last.of_step:.1e}, of the mesh" in search.lines()[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("accuracy", "refined"), [(0.01, False), (1e-4, True)])
def test_a_disc_that_is_turned_in_fluid_at_rest(accuracy: float, refined: bool) -> None:
    """Against the exact torque: the moving grain's load is as accurate as requested, and steps are refined for it.

    For 1% the first steps suffice: they resolve the motion.
    """
    result = run(loads(TURNED, overrides=(f"numerics.accuracy={accuracy}",)))
    search, error = result.adaptation, error_of(result, np.array([COUPLE_ON_TURNED]))
    assert search is not None and search.met and search.reached is not None
    assert error < accuracy and 0.5 < search.reached / error < 3.0
    assert (len(search.trials) > 1) == refined
    if not refined:
        return
    first, last = search.trials[0], search.trials[-1]
    assert first.step is not None and last.step is not None and first.of_mesh is not None
    # The time errs most; the error of the mesh, of third order, may be half of the accuracy.
    more = max(first.of_mesh / (0.5 * accuracy), 1.0) ** (2.0 / 3.0)
    assert last.step < 0.5 * first.step and last.cells < 1.1 * more * first.cells


def test_a_comparison_that_fails_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a coarser run cannot be made steps and cells are halved, and it goes on."""
    called: list[Scene] = []

    def fail_first(scene: Scene, *arguments: Any, **keys: Any) -> Loads:
        called.append(scene)
        if len(called) == 1:
            raise ConvergenceError("no step was accepted")
        return loads_of(scene, *arguments, **keys)

    monkeypatch.setattr(simulate, "loads_of", fail_first)
    search = run(loads(STREAM + "accuracy=0.01\n")).adaptation
    assert search is not None and search.met
    first, second = search.trials[:2]
    why = "not compared: no step was accepted, in a run for comparison"
    assert (first.estimate, first.note, second.note) == (None, why, "")
    assert (first.step, second.step) == (0.1, 0.05)
    assert second.unknowns > first.unknowns


@pytest.mark.slow
def test_two_ranks_choose_alike(tmp_path: Path, mpirun: Any) -> None:
    path = tmp_path / "grain.toml"
    path.write_text(example())
    done = mpirun(2, SCRIPT, path, tmp_path / "out")
    force, unknowns = json.loads(done.stdout.splitlines()[-1])
    alone = run(on_bed(accuracy=0.003)).adaptation
    assert unknowns == pytest.approx([trial.unknowns for trial in alone.trials], rel=0.05)
    assert np.linalg.norm(np.array(force[:2]) - ON_BED) / np.linalg.norm(ON_BED) < 0.003


# `incipient cost` by real runs: of a coarse grain on a bed, in 3-D, of a threshold; and what `incipient plan` prints.
#
# No test here depends on how long anything takes.


COARSE = settings(
    numerics_mesh_size=2.5, contact_gap=0.05, domain_length=12.0, domain_height=6.0, body_x=4.0
)


@pytest.mark.slow
def test_cost_of_a_coarse_grain_on_a_bed(command: Any, tmp_path: Path) -> None:
    """The finest cells err least; what is there is not run again."""
    out = tmp_path / "study"
    arguments = ("cost", GRAIN_ON_BED, "--quick", "--out", out, *COARSE)
    done = command(*arguments, timeout=200)
    assert done.stdout.startswith("As the scene stands (P3-P2, mesh_size 2.5) a run takes ")
    assert "; ten times less error (" in done.stdout
    stored = json.loads((out / "cost.json").read_text())
    assert [run["rung"]["order"] for run in stored["runs"]] == [3, 3, 3, 3]
    assert all(run["peak_mib"] > 50 and run["cpu"] > 0 for run in stored["runs"])
    errors = {row["mesh_size"]: row["errors"]["force"] for row in stored["judged"]}
    assert min(errors, key=errors.get) == min(errors) and max(errors.values()) < 0.2
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    again = command(*arguments, timeout=60)
    assert " of 4:" not in again.stderr
    assert again.stdout == done.stdout


@pytest.mark.slow
def test_cost_in_3d_against_an_exact_force(command: Any, tmp_path: Path) -> None:
    """In an endless shear 6 pi mu r^2 G (1 + e) f, f = 1.6325 (Goldman, Cox & Brenner 1967): the domain errs by 5%."""
    out, force = tmp_path / "study", 1.6325438 * 6.0 * math.pi * 0.5 * 0.55
    size = settings(domain_length=12.0, domain_width=12.0, domain_height=6.0, body_x=6.0)
    coarse = [*size, *settings(numerics_mesh_size=3.0, contact_gap=0.05)]
    arguments = ("cost", SCENES / "sphere_on_plane.toml", "--sizes", 1, "--out", out, *coarse)
    command(*arguments, timeout=600)
    rows = rows_of(out / "cost.csv")
    assert {row["order"] for row in rows} == {"3"} and len(rows) == 2
    for row in rows:
        assert float(row["force_x"]) == pytest.approx(force, rel=0.05)


@pytest.mark.slow
def test_cost_of_a_threshold(command: Any, tmp_path: Path) -> None:
    out = tmp_path / "study"
    size = settings(numerics_mesh_size=3.0, contact_gap=0.05)
    scene = SCENES / "pocket_in_gusts.toml"
    rungs = ("--orders", 3, "--sizes", 1)
    command("cost", scene, "--do", "threshold", *rungs, "--out", out, *size, timeout=200)
    plain = settings(numerics_error_bars=False)
    command("threshold", scene, "--out", tmp_path / "single", *size, *plain, timeout=200)
    own = next(
        row for row in rows_of(out / "cost.csv") if (row["order"], row["mesh_size"]) == ("3", "3.0")
    )
    known = json.loads((tmp_path / "single" / "threshold.json").read_text())
    assert float(own["critical_flow"]) == pytest.approx(known["factor"], rel=1e-6)


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("cost", ["--orders", "7"], "--orders: the velocity has order 2, 3 or 4"),
        ("cost", ["--steps", "2"], "--steps: the scene is steady; leave it out"),
        ("cost", ["--sizes", "0"], "--sizes: give positive numbers, such as 2 1.4 1"),
        (
            "cost",
            ["--sizes", "x"],
            "argument --sizes: invalid float value: 'x'; see incipient cost --help",
        ),
        (
            "cost",
            ["--exact", "force_x"],
            "argument --exact: is retired; compare the columns of cost.csv",
        ),
        ("cost", ["--set", "fluid.reynolds=-1"], "--set fluid.reynolds=-1: fluid.reynolds: "),
        ("cost", ["--set", "flow={kind='still'}"], "flow.kind: the fluid is at rest"),
        (
            "cost",
            ["--do", "threshold", "--set", "body.density=0.9"],
            "a threshold needs a grain denser than the fluid",
        ),
        ("calibrate", [], "calibrate: is retired; `incipient cost SCENE`"),
    ],
)
def test_bad_input_is_one_line(
    said_by: Any, tmp_path: Path, command: str, options: list[str], said: str
) -> None:
    arguments = [str(GRAIN_ON_BED), "--out", str(tmp_path / "study"), *options]
    (line,) = said_by(command, *(arguments if options else []), code=2).splitlines()
    assert line.startswith(f"incipient: {said}")


def test_a_plan_says_the_time_by_runs_of_its_kind(
    said_by: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scaled by the unknowns; other kinds of runs and damaged results say nothing."""
    monkeypatch.chdir(tmp_path)

    def planned(*overrides: str) -> list[str]:
        lines = said_by("plan", CAVITY, *settings(numerics_mesh_size=4), *overrides).splitlines()
        return [line.strip() for line in lines if "of wall time" in line]

    assert planned() == []
    coarse = settings(numerics_mesh_size=6)
    assert main(["run", str(CAVITY), *coarse, "--log-level", "error"]) == 0
    result = tmp_path / "results" / CAVITY.stem / "result.json"
    cost = json.loads(result.read_text())["cost"]
    plan = json.loads(said_by("plan", CAVITY, *settings(numerics_mesh_size=4), "--json"))
    unknowns = plan["estimate"]["unknowns"]
    taken = seconds(cost["wall_time"]["total"] * unknowns / cost["unknowns"])
    assert planned() == [f"about {taken} of wall time, scaled from results/{CAVITY.stem}"]
    assert planned(*settings(numerics_order=2)) == []
    result.write_text("{")
    assert planned() == []
    assert not plan["warnings"]
    monkeypatch.setattr("incipient.accuracy.first_mesh.free_bytes", lambda: 2.0**20)
    assert "warning: 1 MiB of memory are free, which may not" in said_by("plan", CAVITY)
