"""One scene with its effects switched on one after another: what each costs, and what it changes.

A gust sweeps over a disc in the pocket of a bed. Stokes flow at every moment comes first; then inertia, the rate of
change, and at last the grain is let go, with a mesh that follows it.

Cost:    about a minute.
Run:     python benchmarks/effects.py [--report]
Results: benchmarks/effects.json, docs/figures/effects.png, the table in docs/effects.md; --report only rewrites these
"""

import argparse
import csv
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
SCENE = ROOT / "benchmarks/scenes/gust.toml"
STORE, PAGE = ROOT / "benchmarks/effects.json", ROOT / "docs/effects.md"
FIGURE = ROOT / "docs/figures/effects.png"
BEGIN, END = "<!-- effects: begin -->", "<!-- effects: end -->"
# A free grain starts a little above its place in the pocket: the closest it may come to the bed is contact.gap.
RAISED = 0.05
STEPS = {
    "Stokes flow": ("effects.inertia=false", "effects.unsteadiness=false"),
    "+ inertia": ("effects.inertia=true", "effects.unsteadiness=false"),
    "+ rate of change": ("effects.inertia=true", "effects.unsteadiness=true"),
    "+ moving mesh, free grain": ("effects.inertia=true", "effects.unsteadiness=true"),
}
COLOURS = ("#4393c3", "#2166ac", "#b2182b", "#1b7837")

Run = dict[str, Any]


def measured() -> dict[str, Run]:
    """All runs, the forms compiled before: each is made twice, and the second counts."""
    found = {}
    for name, overrides in STEPS.items():
        scene = freed(overrides) if "free" in name else fixed(overrides)
        run_of(scene, "time.end=0.2")
        found[name] = run_of(scene)
        print(f"{name}: {found[name]['seconds']:.1f} s", flush=True)
    return found


def fixed(overrides: tuple[str, ...]) -> dict[str, Any]:
    """What the disc that is held in the pocket needs to be loaded."""
    return {"text": SCENE.read_text(), "overrides": overrides}


def freed(overrides: tuple[str, ...]) -> dict[str, Any]:
    """The disc let go; it ends where it comes near the bed."""
    from incipient.scene import load

    x, y = load(SCENE).placement.centre
    free = f'centre = [{x}, {y + RAISED}]\nmotion = "free"'
    return {"text": SCENE.read_text().replace("x = 4.0", free), "overrides": overrides}


def run_of(scene: dict[str, Any], *more: str) -> Run:
    """One run: history of force and mode, what was left out, and the cost."""
    import incipient
    from incipient.scene import loads

    loaded = loads(scene["text"], SCENE.parent, (*scene["overrides"], *more))
    with tempfile.TemporaryDirectory() as directory:
        result = incipient.run(loaded, directory)
        with (Path(directory) / "history.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
    return {
        "time": [float(row["time"]) for row in rows],
        "force": [[float(row["force_x"]), float(row["force_y"])] for row in rows],
        "place": [[float(row["x"]), float(row["y"])] for row in rows] if "x" in rows[0] else None,
        "mode": [row.get("mode", "") for row in rows],
        "first_motion": (result.verdict or {}).get("first_motion"),
        "omitted": {one.name: one.relative for one in result.omitted},
        "seconds": sum(share["wall_time"] for share in result.cost["effects"].values()),
        "effects": result.cost["effects"],
        "unknowns": result.cost["unknowns"],
        "newton": result.cost["iterations"]["newton"],
    }


# -- the page ----------------------------------------------------------------------------------------


def table(runs: dict[str, Run]) -> str:
    """What each step changes, as Markdown."""
    rows = [
        "| effects | largest drag | at t | largest lift | verdict | what was left out would change | time |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, run in runs.items():
        force = np.array(run["force"])
        k = int(force[:, 0].argmax())
        rows.append(
            f"| {name} | {force[k, 0]:.2f} | {run['time'][k]:.1f} | {force[:, 1].max():.2f} | {verdict(run)} "
            f"| {left_out(run)} | {run['seconds']:.1f} s |"
        )
    return "\n".join(rows)


def verdict(run: Run) -> str:
    """When the grain begins to move and how; of a free one, how far it went."""
    if run["place"] is not None:
        place = np.array(run["place"])
        way = np.abs(place[:, 0] - place[0, 0]).max()
        return f"carried {way:.3f} along, and stays in the pocket"
    if run["first_motion"] is None:
        return "rests"
    mode = next(mode for mode in run["mode"] if mode != "rest")
    return f"{mode} from t = {run['first_motion']:.1f}"


def left_out(run: Run) -> str:
    """Effects left out, with what they would have changed at the end of the run."""
    known = {name: value for name, value in run["omitted"].items() if value is not None}
    return ", ".join(f"{name}: {100 * value:.0f}%" for name, value in known.items()) or "-"


def draw(runs: dict[str, Run]) -> None:
    """Drag against time in each step, and the cost by effect."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(
        1, 2, figsize=(11, 4), width_ratios=(1.3, 1), layout="constrained"
    )
    for (name, run), colour in zip(runs.items(), COLOURS, strict=True):
        left.plot(run["time"], np.array(run["force"])[:, 0], color=colour, label=name)
    left.set(
        xlabel="time [1 / shear rate]", ylabel="drag on the grain", title="What each effect changes"
    )
    left.legend(frameon=False)
    effects = list(dict.fromkeys(e for run in runs.values() for e in run["effects"]))
    bottoms = np.zeros(len(runs))
    for effect in effects:
        heights = np.array(
            [run["effects"].get(effect, {}).get("wall_time", 0.0) for run in runs.values()]
        )
        if heights.max() > 0.01 * max(run["seconds"] for run in runs.values()):
            right.barh(list(runs), heights, left=bottoms, label=effect)
            bottoms += heights
    right.invert_yaxis()
    right.set(xlabel="wall time [s]", title="What each effect costs")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    FIGURE.parent.mkdir(exist_ok=True)
    figure.savefig(FIGURE, dpi=150)


def report(runs: dict[str, Run]) -> None:
    """Rewrite the table in the page, and the figure."""
    before, _, rest = PAGE.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}\n{table(runs)}\n{END}{after}")
    draw(runs)


def main() -> None:
    """Measure unless told not to, and write it all down."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "--report", action="store_true", help="only rewrite the page and the figure"
    )
    if not parser.parse_args().report:
        STORE.write_text(json.dumps(measured(), indent=1) + "\n")
    report(json.loads(STORE.read_text()))


if __name__ == "__main__":
    main()
