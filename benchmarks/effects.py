"""One scene with its effects switched on one after another: what each costs, and what it changes.

A gust sweeps over a disc in the pocket of a bed. Stokes flow at every moment comes first; then inertia, the rate of
change, and at last the grain is let go, with a mesh that follows it.

Cost:    about a minute.
Run:     python benchmarks/effects.py [--report]
Results: benchmarks/effects.json, docs/figures/effects.png, the table "effects"; --report only rewrites these
"""

import argparse
from typing import Any

import numpy as np
from pictures import FIGURES, drawn, plain
from runs import run_with_history
from tables import ROOT, publish, read_json, table, write_json

from incipient.scene import Scene, load, loads

SCENE = ROOT / "benchmarks/scenes/gust.toml"
STORE = ROOT / "benchmarks/effects.json"
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
    runs = {}
    for name, overrides in STEPS.items():
        run_of(scene(name, (*overrides, "time.end=0.2")))
        runs[name] = run_of(scene(name, overrides))
        print(f"{name}: {runs[name]['seconds']:.1f} s", flush=True)
    return runs


def scene(name: str, overrides: tuple[str, ...]) -> Scene:
    """The disc in the pocket, which is held or let go; then it ends where it comes near the bed."""
    text = SCENE.read_text()
    if "free" in name:
        x, y = load(SCENE).placement.centre
        text = text.replace("x = 4.0", f'centre = [{x}, {y + RAISED}]\nmotion = "free"')
    return loads(text, SCENE.parent, overrides)


def run_of(scene: Scene) -> Run:
    """One run: history of force and mode, what was left out, and the cost."""
    result, rows = run_with_history(scene)
    return {
        "time": [row["time"] for row in rows],
        "force": [[row["force_x"], row["force_y"]] for row in rows],
        "place": [[row["x"], row["y"]] for row in rows] if "x" in rows[0] else None,
        "mode": [row.get("mode", "") for row in rows],
        "first_motion": (result.verdict or {}).get("first_motion"),
        "omitted": {effect.name: effect.relative for effect in result.omitted},
        "seconds": sum(share["wall_time"] for share in result.cost["effects"].values()),
        "effects": result.cost["effects"],
        "unknowns": result.cost["unknowns"],
        "newton": result.cost["iterations"]["newton"],
    }


# -- the page ----------------------------------------------------------------------------------------


HEADS = ("effects", "largest drag", "at t", "largest lift", "verdict", "left out", "time")


def cells(name: str, run: Run) -> list[str]:
    """A row of the table: what a step changes, and what those left out would have changed at the end."""
    drag, lift = np.array(run["force"]).T
    at = run["time"][int(drag.argmax())]
    known = {name: value for name, value in run["omitted"].items() if value is not None}
    left_out = ", ".join(f"{name}: {100 * value:.0f}%" for name, value in known.items())
    loads = (f"{drag.max():.2f}", f"{at:.1f}", f"{lift.max():.2f}")
    return [name, *loads, verdict(run), left_out or "-", f"{run['seconds']:.1f} s"]


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


def draw(runs: dict[str, Run]) -> None:
    """Drag against time in each step, and the cost by effect."""
    target, widths = FIGURES / "effects.png", (1.3, 1)
    with drawn(target, (11, 4), columns=2, width_ratios=widths) as (_, panels):
        left, right = panels[0]
        for (name, run), colour in zip(runs.items(), COLOURS, strict=True):
            left.plot(run["time"], np.array(run["force"])[:, 0], color=colour, label=name)
        effects = list(dict.fromkeys(e for run in runs.values() for e in run["effects"]))
        bottoms = np.zeros(len(runs))
        for effect in effects:
            costs = [run["effects"].get(effect, {}).get("wall_time", 0.0) for run in runs.values()]
            if max(costs) > 0.01 * max(run["seconds"] for run in runs.values()):
                right.barh(list(runs), costs, left=bottoms, label=effect)
                bottoms += costs
        right.invert_yaxis()
        left.set(xlabel="time [1 / shear rate]", ylabel="drag on the grain")
        left.set_title("What each effect changes")
        right.set(xlabel="wall time [s]", title="What each effect costs")
        plain(panels)
        left.legend()
        right.legend()


def main() -> None:
    """Measure unless told not to, and write it all down."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "--report", action="store_true", help="only print the table and draw the figure"
    )
    if not parser.parse_args().report:
        write_json(STORE, measured())
    runs = read_json(STORE)
    publish("effects", table(HEADS, [cells(name, run) for name, run in runs.items()]))
    draw(runs)


if __name__ == "__main__":
    main()
