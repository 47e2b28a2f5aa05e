"""The paths of the pebble in the pothole with their errors, in all readings: figures.

Physics: `demos/pothole.py`; steps and meshes are refined, and the end of the path extrapolated.
Cost:    half an hour on two cores.
Run:     python benchmarks/pothole.py [--processes 2] [--report]
Results: benchmarks/pothole.json, docs/figures/pothole*.png; --report only rewrites these
"""

import argparse
import json
import multiprocessing
import runpy
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from pictures import FIGURES, drawn
from runs import run_with_history
from tables import ROOT, read_json

from incipient.geometry.placement import Placement

STORE = ROOT / "benchmarks/pothole.json"
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
    """All runs: steps and meshes of each case, other readings and shapes."""
    for case in CASES:
        yield from (Job(case, step=step) for step in STEPS)
        yield from (Job(case, step=STEPS[0], mesh_size=size) for size in SIZES if size != 1.0)
    yield from (Job(case, "neutral") for case in CASES)
    yield from (Job(1, reading) for reading in ("rest", "grain"))
    yield from (Job(1, shape=shape) for shape in ("disc", "square"))


def run(job: Job) -> Run:
    """Compute a path: `path` (SAMPLES, 4) of time, x, y, angle, and what the end is."""
    # All steps alike, from the first on: by what the step changes the end of the path is extrapolated.
    settings = [f"time.step={job.step}", "time.first_step=1", f"numerics.mesh_size={job.mesh_size}"]
    settings.append("output.fields=false")
    scene = demo()["scene"](job.case, job.reading, job.shape, settings)
    result, rows = run_with_history(scene)
    path = np.array([[row[name] for name in ("time", "x", "y", "angle")] for row in rows])
    path = np.vstack([[0.0, *scene.body.centre, 0.0], path])
    times = np.linspace(0.0, path[-1, 0], SAMPLES)
    samples = np.column_stack([np.interp(times, path[:, 0], column) for column in path.T])
    end = result.trajectory
    assert end is not None
    return {
        **{key: np.asarray(end[key]).tolist() for key in ("place", "angle", "velocity", "spin")},
        "ended": end["ended"],
        "unknowns": result.cost["unknowns"],
        "seconds": round(result.cost["wall_time"]["total"], 1),
        "meshes": 1 + len(end["remeshings"]),
        "mass": scene.body.mass,
        "inertia": scene.body.inertia,
        "path": samples.round(5).tolist(),
    }


@cache
def demo() -> dict[str, Any]:
    """What the demo defines."""
    return runpy.run_path(str(ROOT / "demos/pothole.py"))


# -- errors -----------------------------------------------------------------------------------------


def extrapolated(store: dict[str, Run], case: int) -> tuple[np.ndarray, np.ndarray]:
    """End of a path (x, y, angle) by Richardson's extrapolation from the three shortest steps, and its error.

    The order is the one observed, between 1 and 2, of the place (lengths) and angle (times the large semi-axis).
    The extrapolation is taken to err by what it adds, the mesh by the most its refinement changes.
    """

    def end(**numerics: float) -> list[float]:
        """Place and angle at the end of one run."""
        path = store[Job(case, **numerics).name]  # type: ignore[arg-type]
        return [*path["place"], path["angle"]]

    ends = np.array([end(step=step) for step in STEPS])
    changes = np.diff(ends, axis=0)
    before, last = np.linalg.norm(changes[-2:] * [1.0, 1.0, 2.0], axis=1)
    added = changes[-1] / (2 ** np.clip(np.log2(before / last), 1.0, 2.0) - 1)
    meshes = np.array([end(step=STEPS[0], mesh_size=size) for size in SIZES])
    return ends[-1] + added, np.abs(added) + np.ptp(meshes, axis=0)


# -- the figures --------------------------------------------------------------------------------------


READINGS = {
    "printed: 40 times as dense as the fluid": Job(1),
    "neutral: as dense as the fluid": Job(1, "neutral"),
    "rest: the lid starts at t = 0": Job(1, "rest"),
    "grain: t in grain lengths / lid speed": Job(1, "grain"),
}
SHAPES = {shape: Job(1, shape=shape) for shape in ("ellipse", "disc", "square")}


def draw(store: dict[str, Run]) -> None:
    """The four paths; the other readings and shapes."""
    with drawn(FIGURES / "pothole.png", (8.0, 8.4), rows=2, columns=2) as (_, panels):
        for axes, case in zip(panels.flat, CASES, strict=True):
            run, (end, error) = store[Job(case, step=STEPS[-1]).name], extrapolated(store, case)
            _cavity(axes)
            _path(axes, run, "ellipse", COLOURS[0], every=0.4)
            x, y, angle = (f"{v:.3f} ± {e:.3f}" for v, e in zip(end, error, strict=True))
            axes.set_title(
                f"m = {run['mass']:g}, J = {run['inertia']:g}, t = {run['ended']['time']:g}"
            )
            axes.set_xlabel(f"end: x = {x}, y = {y}\nangle = {angle}")
    with drawn(FIGURES / "pothole_readings.png", (8.0, 4.5), columns=2) as (_, panels):
        for axes, variants in zip(panels[0], (READINGS, SHAPES), strict=True):
            _cavity(axes)
            for colour, (label, job) in zip(COLOURS, variants.items(), strict=False):
                _path(axes, store[job.name], job.shape, colour, every=0.9, label=label)
            axes.legend(loc="lower left", frameon=False)
        panels[0, 0].set_title("Readings of the print, case 1")
        panels[0, 1].set_title("Shapes of one area and mass, case 1")


def _cavity(axes: Axes) -> None:
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


def _path(
    axes: Axes, run: Run, shape: str, colour: str, every: float, label: str | None = None
) -> None:
    """The way of the centre, and the outline at the start, every so much time, and at the end."""
    times, *places = np.array(run["path"]).T
    axes.plot(places[0], places[1], color=colour, linewidth=1.0, label=label)
    outline, s = demo()["SHAPES"][shape].grain.outline(), np.linspace(0, 1, 40)
    for time in [*np.arange(0.0, times[-1] - 0.3 * every, every), times[-1]]:
        x, y, angle = (float(np.interp(time, times, column)) for column in places)
        placement = Placement((x, y), angle)
        points = np.vstack([curve.moved(placement).point(s) for curve in outline])
        alpha = 0.75 if time == times[-1] else 0.25
        axes.fill(*points.T, facecolor=colour, edgecolor=colour, alpha=alpha, linewidth=0.8)


def main() -> None:
    """Compute what is missing, and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--report", action="store_true", help="rewrite figures from pothole.json")
    options = parser.parse_args()
    store = read_json(STORE, {})
    if not options.report:
        compute(store, options.processes)
    draw(store)


def compute(store: dict[str, Run], processes: int) -> None:
    """Run what is not in the store yet."""
    with ProcessPoolExecutor(
        processes, multiprocessing.get_context("spawn"), max_tasks_per_child=1
    ) as pool:
        under_way = {pool.submit(run, job): job for job in jobs() if job.name not in store}
        for done in as_completed(under_way):
            job = under_way[done]
            store[job.name] = done.result()
            print(job.name, store[job.name]["place"], f"{store[job.name]['seconds']} s", flush=True)
            STORE.write_text(json.dumps(store) + "\n")


if __name__ == "__main__":
    main()
