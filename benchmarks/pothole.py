"""The paths of the pebble in the pothole with their errors, in all readings: figures.

Physics: `demos/pothole.py`; steps and meshes are refined, and the end of the path extrapolated.
Cost:    half an hour on two cores.
Run:     python benchmarks/pothole.py [--processes 2] [--report]
Results: benchmarks/pothole.json, docs/figures/pothole*.png; --report only rewrites these
"""

import argparse
import importlib.util
import json
import multiprocessing
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
STORE, FIGURES = (
    ROOT / "benchmarks/pothole.json",
    ROOT / "docs/figures",
)
CASES = (1, 2, 3, 4)
STEPS, SIZES = (0.05, 0.025, 0.0125, 0.00625), (1.4, 1.0, 0.7)
SAMPLES = 181  # places kept of a path
COLOURS = ("#2166ac", "#b2182b", "#1b7837", "#e08214")

Run = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One run: a case of the figure in a reading, with a shape, a step and a mesh."""

    case: int
    reading: str = "printed"
    shape: str = "ellipse"
    step: float = 0.025
    mesh_size: float = 1.0

    @property
    def name(self) -> str:
        return f"{self.case} {self.reading} {self.shape} {self.step:g} {self.mesh_size:g}"


def jobs() -> Iterator[Job]:
    """All runs."""
    for case in CASES:
        yield from (Job(case, step=step) for step in STEPS)
        yield from (Job(case, step=STEPS[0], mesh_size=size) for size in SIZES if size != 1.0)
    yield from others()


def others() -> Iterator[Job]:
    """Other readings and shapes."""
    yield from (Job(case, "neutral") for case in CASES)
    yield from (Job(1, reading) for reading in ("rest", "grain"))
    yield from (Job(1, shape=shape) for shape in ("disc", "square"))


def run(job: Job) -> Run:
    """Compute a path: `path` (SAMPLES, 4) of time, x, y, angle, and what the end is."""
    import incipient

    # All steps alike, from the first on: by what the step changes the end of the path is extrapolated.
    settings = [f"time.step={job.step}", "time.first_step=1", f"numerics.mesh_size={job.mesh_size}"]
    settings.append("output.fields=false")
    given = pothole().scene(job.case, job.reading, job.shape, settings)
    with tempfile.TemporaryDirectory() as place:
        result = incipient.run(given, place)
        history = np.genfromtxt(Path(place) / "history.csv", delimiter=",", names=True)
    path = np.column_stack([history[name] for name in ("time", "x", "y", "angle")])
    path = np.vstack([[0.0, *given.body.centre, 0.0], path])
    times = np.linspace(0.0, path[-1, 0], SAMPLES)
    kept = np.column_stack([times, *(np.interp(times, path[:, 0], path[:, k]) for k in (1, 2, 3))])
    assert result.trajectory is not None
    told = {key: result.trajectory[key] for key in ("place", "angle", "velocity", "spin", "ended")}
    told["place"], told["velocity"] = (
        np.asarray(told[key]).tolist() for key in ("place", "velocity")
    )
    cost = {
        "unknowns": result.cost["unknowns"],
        "seconds": round(result.cost["wall_time"]["total"], 1),
    }
    return {
        **told,
        **cost,
        "meshes": 1 + len(result.trajectory["remeshings"]),
        "mass": given.body.mass,
        "inertia": given.body.inertia,
        "path": kept.round(5).tolist(),
    }


def pothole() -> Any:
    """The demo as a module."""
    source = importlib.util.spec_from_file_location("pothole", ROOT / "demos/pothole.py")
    assert source is not None and source.loader is not None
    module = importlib.util.module_from_spec(source)
    source.loader.exec_module(module)
    return module


# -- errors -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class End:
    """End of a path (x, y, angle) for steps to nothing, its error by steps and by mesh, the order in the step."""

    values: np.ndarray
    of_steps: np.ndarray
    of_mesh: np.ndarray
    order: float

    @property
    def error(self) -> np.ndarray:
        """Both together."""
        return self.of_steps + self.of_mesh


def end(store: dict[str, Run], job: Job) -> np.ndarray:
    """Place and angle at the end of one run."""
    run = store[job.name]
    return np.array([*run["place"], run["angle"]])


def extrapolated(store: dict[str, Run], case: int) -> End:
    """Richardson's extrapolation from the three shortest steps, and what three meshes say.

    The order is the one observed, between 1 and 2, of the place (lengths) and angle (times the large semi-axis).
    The extrapolation is taken to err by what it adds, the mesh by the most its refinement changes.
    """
    ends = np.array([end(store, Job(case, step=step)) for step in STEPS])
    changes = np.diff(ends, axis=0)
    unit = np.array([1.0, 1.0, 2.0])
    order = float(np.log2(np.linalg.norm(changes[-2] * unit) / np.linalg.norm(changes[-1] * unit)))
    added = changes[-1] / (2 ** np.clip(order, 1.0, 2.0) - 1)
    meshes = np.array([end(store, Job(case, step=STEPS[0], mesh_size=size)) for size in SIZES])
    return End(ends[-1] + added, np.abs(added), np.ptp(meshes, axis=0), order)


# -- the figures --------------------------------------------------------------------------------------


def figures(store: dict[str, Run]) -> None:
    """The four paths; the other readings and shapes."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(8.0, 8.4), layout="constrained")
    for axes, case in zip(made.subplots(2, 2).flat, CASES, strict=True):
        run, found = store[Job(case, step=STEPS[-1]).name], extrapolated(store, case)
        _cavity(axes)
        _path(axes, run, pothole().SHAPES["ellipse"], "#2166ac", every=0.4)
        x, y, angle = (f"{v:.3f} ± {e:.3f}" for v, e in zip(found.values, found.error, strict=True))
        axes.set_title(
            f"m = {run['mass']:g}, J = {run['inertia']:g}, t = {run['ended']['time']:g}",
            fontsize=10,
        )
        axes.set_xlabel(f"end: x = {x}, y = {y}\nangle = {angle}", fontsize=8.5)
    made.savefig(FIGURES / "pothole.png", dpi=160)
    made = Figure(figsize=(8.0, 4.5), layout="constrained")
    left, right = made.subplots(1, 2)
    for axes, picked in ((left, _readings()), (right, _shapes())):
        _cavity(axes)
        for colour, (label, job) in zip(COLOURS, picked.items(), strict=False):
            _path(
                axes, store[job.name], pothole().SHAPES[job.shape], colour, every=0.9, label=label
            )
        axes.legend(loc="lower left", fontsize=8, frameon=False)
    left.set_title("Readings of the print, case 1", fontsize=10)
    right.set_title("Shapes of one area and mass, case 1", fontsize=10)
    made.savefig(FIGURES / "pothole_readings.png", dpi=160)


def _readings() -> dict[str, Job]:
    told = {
        "printed": "printed: 40 times as dense as the fluid",
        "neutral": "neutral: as dense as the fluid",
    }
    told |= {
        "rest": "rest: the lid starts at t = 0",
        "grain": "grain: t in grain lengths / lid speed",
    }
    return {label: Job(1, reading) for reading, label in told.items()}


def _shapes() -> dict[str, Job]:
    return {shape: Job(1, shape=shape) for shape in ("ellipse", "disc", "square")}


def _cavity(axes: Any) -> None:
    axes.set(xlim=(-1, 41), ylim=(-1, 43), aspect="equal", xticks=[0, 20, 40], yticks=[0, 20, 40])
    axes.plot([0, 0, 40, 40], [40, 0, 0, 40], color="#333333", linewidth=1.2)
    axes.plot([0, 40], [40, 40], color="#b2182b", linewidth=1.8)
    axes.annotate(
        "",
        (27, 41.6),
        (13, 41.6),
        arrowprops={"arrowstyle": "-|>", "color": "#b2182b", "linewidth": 1.2},
    )
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0, labelsize=8)


def _path(axes: Any, run: Run, shape: Any, colour: str, every: float, label: str = "") -> None:
    """The way of the centre, and the outline at the start, every so much time, and at the end."""
    from incipient.geometry.placement import Placement

    path = np.array(run["path"])
    axes.plot(path[:, 1], path[:, 2], color=colour, linewidth=1.0, label=label or None)
    s = np.linspace(0, 1, 40)
    times = [*np.arange(0.0, path[-1, 0] - 0.3 * every, every), path[-1, 0]]
    for time in times:
        x, y, angle = (float(np.interp(time, path[:, 0], path[:, k])) for k in (1, 2, 3))
        placement = Placement((x, y), angle)
        outline = np.vstack([curve.moved(placement).point(s) for curve in shape.grain.outline()])
        last = time == path[-1, 0]
        axes.fill(
            *outline.T,
            facecolor=colour,
            edgecolor=colour,
            alpha=0.75 if last else 0.25,
            linewidth=0.8,
        )


def main() -> None:
    """Compute what is missing, and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--report", action="store_true", help="rewrite figures from pothole.json")
    options = parser.parse_args()
    store = json.loads(STORE.read_text()) if STORE.exists() else {}
    if not options.report:
        compute(store, options.processes)
    figures(store)


def compute(store: dict[str, Run], processes: int) -> None:
    """Run what is not in the store yet."""
    left = [job for job in jobs() if job.name not in store]
    with ProcessPoolExecutor(
        processes, multiprocessing.get_context("spawn"), max_tasks_per_child=1
    ) as pool:
        under_way = {pool.submit(run, job): job for job in left}
        for done in as_completed(under_way):
            job = under_way[done]
            store[job.name] = done.result()
            print(job.name, store[job.name]["place"], f"{store[job.name]['seconds']} s", flush=True)
            STORE.write_text(json.dumps(store) + "\n")


if __name__ == "__main__":
    main()
