"""What resists rolling along a plane with inertia, by the gap and the cells: a table.

Physics: a disc, and a sphere, made to roll without slip along a level bed in fluid at rest. The force that keeps it
         going is the drag and, as friction at the contact holds the couple of the flow, that couple over the radius.
Cost:    a quarter of an hour of processor time; what is in the results is not computed again.
Run:     python benchmarks/rolling_drag.py [--report]
Results: benchmarks/rolling_drag.json, the table "rolling drag"; --report makes them from the first
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from tables import publish

import incipient
from incipient.scene import Scene

ROOT = Path(__file__).parents[1]
STORE = ROOT / "benchmarks/rolling_drag.json"
REYNOLDS, GAPS = 20.0, (0.04, 0.02, 0.01, 0.005, 0.0025)  # gap over the diameter
CELLS = {2: (2.0, 1.0, 0.5), 3: (2.8, 2.0)}  # factors on the size of cells, by the dimension
BOX = {2: (36.0, 8.0), 3: (20.0, 5.0)}  # length and height in diameters
WIDTH, START = 6.0, 7.0
LASTS, STEP = {2: 20.0, 3: 8.0}, {2: 0.1, 3: 0.2}  # diameters rolled, and in a step
FEWER = {3: (0.02, 0.01)}  # gaps of the sphere

Found = dict[str, Any]


def scene(gdim: int, gap: float, cells: float) -> Scene:
    """A grain that rolls at its reference velocity after a smooth start."""
    (length, height), start, rolls = BOX[gdim], "tanh(2*t)", "2*tanh(2*t)"
    if gdim == 2:
        place, course, across = (START, 0.5 + gap), [start, "0", f"-{rolls}"], {}
    else:
        place, across = (START, 0.5 * WIDTH, 0.5 + gap), {"width": WIDTH}
        course = [start, "0", "0", "0", rolls, "0"]
    return Scene(
        domain={"kind": "box", "length": length, "height": height, **across},
        fluid={"reynolds": REYNOLDS, "scale": "grain"},
        flow={"kind": "still", "velocity": 1.0},
        bed={"kind": "flat"},
        body={
            "shape": "disc" if gdim == 2 else "sphere",
            "diameter": 1.0,
            "centre": place,
            "motion": "prescribed",
            "course": course,
            "density": 2.0,
        },
        contact={"friction": 1.0, "gap": 0.5 * gap},
        time={"end": LASTS[gdim], "step": STEP[gdim]},
        numerics={"error_bars": False, "mesh_size": cells},
        output={"fields": False},
    )


def coefficient(gdim: int, gap: float, cells: float) -> float:
    """The force over half of U^2 times the grain's width or cross section, at the end."""
    with tempfile.TemporaryDirectory() as place:
        incipient.run(scene(gdim, gap, cells), place)
        table = np.genfromtxt(Path(place) / "history.csv", delimiter=",", names=True)
    drag, couple = (
        -table["force_x"][-1],
        table["torque"][-1] if gdim == 2 else -table["torque_y"][-1],
    )
    return float(2.0 * (drag + 2.0 * couple) / (1.0 if gdim == 2 else math.pi / 4.0))


def creeping(gap: float) -> float:
    """The disc's coefficient without inertia (Jeffery 1922), at the same Reynolds number."""
    s = 1.0 + 2.0 * gap
    return 8.0 * math.pi / REYNOLDS * (1.0 / math.acosh(s) + s / math.sqrt(s * s - 1.0))


def compute() -> list[Found]:
    """All that is not in the store yet."""
    found: list[Found] = json.loads(STORE.read_text()) if STORE.exists() else []
    known = {(one["gdim"], one["gap"], one["cells"]) for one in found}
    for gdim in (2, 3):
        for gap in FEWER.get(gdim, GAPS):
            for cells in CELLS[gdim]:
                if (gdim, gap, cells) not in known:
                    found.append({"gdim": gdim, "gap": gap, "cells": cells})
                    found[-1]["coefficient"] = coefficient(gdim, gap, cells)
                    print(found[-1], flush=True)
                    STORE.write_text(json.dumps(found, indent=1) + "\n")
    return found


def table(found: list[Found]) -> list[str]:
    """The rows of the page."""
    values = {(one["gdim"], one["gap"], one["cells"]): one["coefficient"] for one in found}
    heads = [f"disc, cells of {cells:g}" for cells in CELLS[2]] + ["creeping flow (Jeffery 1922)"]
    heads += [f"sphere, cells of {cells:g}" for cells in CELLS[3]]
    rows = [f"| gap | {' | '.join(heads)} |", f"| --: {'| --: ' * len(heads)}|"]
    for gap in GAPS:
        discs = [f"{values[2, gap, cells]:.3f}" for cells in CELLS[2]]
        spheres = [
            f"{values[3, gap, one]:.3f}" if (3, gap, one) in values else "" for one in CELLS[3]
        ]
        rows.append(f"| {gap:.2%} | {' | '.join([*discs, f'{creeping(gap):.3f}', *spheres])} |")
    return rows


def written(found: list[Found]) -> None:
    """Put the table into the page."""
    publish("rolling drag", "\n".join(table(found)))


if __name__ == "__main__":
    written(json.loads(STORE.read_text()) if "--report" in sys.argv[1:] else compute())
