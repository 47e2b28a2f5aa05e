"""Beads on substrates of spheres: a figure of what demos/bead_on_substrate.py has found.

Cost:    seconds; with `--study` all beads are computed before, one or two minutes each.
Run:     python benchmarks/beads.py [--study] [RESULTS]
Results: docs/validation/beads.csv, docs/figures/beads_spacing.png; without RESULTS it is drawn from the first
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from math import atan2, degrees, nan, sqrt
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from pictures import FIGURES, drawn, plain
from tables import DOCS, ROOT, Row, read_rows

import incipient

STORE = DOCS / "validation/beads.csv"
TERMS = ("discretisation", "gap", "domain", "planar far bed")
KEY = ("arrangement", "spacing", "size", "reynolds")
NAMES: tuple[str, ...] = (*KEY, "contacts", "angle", "shields", "error", *TERMS)
NAMES += ("mode", "drag", "lift", "couple", "cells")
STUDY: list[tuple[str | float, ...]] = [
    (kind, spacing, 1.0)
    for kind in ("square", "triangular")
    for spacing in (1.0, 1.1, 1.2, 1.3, 1.4)
]
STUDY += [(kind, 1.0, size) for kind in ("square", "triangular") for size in (0.5, 0.7, 1.4, 2.0)]
STUDY += [
    ("triangular", 1.0, 1.0, reynolds) for reynolds in (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 240.0)
]
COLOURS = {"square": "#2166ac", "triangular": "#b2182b"}
AROUND = {
    "square": 1 / 2,
    "triangular": 1 / 3,
}  # squared distance from a pocket's middle to the centres, in spacings


def row_of(directory: Path) -> Row:
    """What the threshold in a directory says, made dimensionless; lengths in diameters of the bed's spheres."""
    scene = incipient.load(directory / "scene.toml")
    threshold = json.loads((directory / "threshold.json").read_text())
    bed, size, load, contacts = (
        scene.bed,
        threshold["size"],
        threshold["load"],
        threshold["contacts"],
    )
    share, bars = threshold["shields"] / threshold["factor"], threshold["error_bars"]
    unit = threshold["factor"] * scene.viscosity * scene.flow.rate * size**2  # type: ignore[union-attr]
    ahead = max(contacts["normals"], key=lambda normal: normal[0])
    terms = {
        name: share * (bars["factor"]["terms"].get(name, nan) if bars else nan) for name in TERMS
    }
    return {
        "arrangement": bed.arrangement,  # type: ignore[union-attr]
        "spacing": bed.spacing / (2.0 * bed.radius),  # type: ignore[union-attr]
        "size": size / (2.0 * bed.radius),  # type: ignore[union-attr]
        "reynolds": threshold["shear_reynolds"] ** 2 if scene.fluid.inertia else 0.0,
        "contacts": len(contacts["points"]),
        "angle": degrees(atan2(ahead[0], -ahead[2])),
        "shields": threshold["shields"],
        "error": threshold["errors"]["shields"] or nan,
        **terms,
        "mode": threshold["mode"],
        "drag": load["flow_force"][0] / unit,
        "lift": load["flow_force"][2] / unit,
        "couple": load["flow_couple"][1] / (unit * size),
        "cells": threshold["cost"]["cells"],
    }


def gather(results: Path) -> list[Row]:
    """The rows of all beads there is a threshold of, in order; errors that were not estimated are nan."""
    files = [
        path
        for path in results.glob("bead_*/threshold.json")
        if json.loads(path.read_text())["factor"]
    ]
    rows = [row_of(path.parent) for path in files]
    return sorted(rows, key=lambda row: tuple(row[name] for name in KEY))


def store(rows: list[Row]) -> None:
    """Write docs/validation/beads.csv, four digits of every number."""
    with STORE.open("w", newline="") as file:
        table = csv.DictWriter(file, NAMES, lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: v if isinstance(v, str) else f"{v:.4g}" for k, v in row.items()})


# -- the figures --------------------------------------------------------------------------------------------


def draw(rows: list[Row]) -> None:
    """Shields number against spacing, with error bars."""
    rows = [row for row in rows if not row["reynolds"] and row["size"] == 1.0]
    with drawn(FIGURES / "beads_spacing.png", (6.2, 4.2)) as (_, panels):
        axes = panels[0, 0]
        for kind, colour in COLOURS.items():
            beads = [row for row in rows if row["arrangement"] == kind]
            beads.sort(key=lambda row: float(row["spacing"]))
            _series(axes, beads, f"{kind} substrate", colour)
            touching = [row["shields"] for row in beads if row["spacing"] == 1.0]
            if touching:
                s = np.linspace(1.0, min(1.4, sqrt(0.75 / AROUND[kind])), 60)
                slope = slope_of(kind, s)
                axes.plot(s, touching[0] * slope / slope[0], "--", color=colour, lw=0.9)
        label = "in proportion to the tangent of the angle of repose"
        axes.plot([], [], "--", color=COLOURS["square"], lw=0.9, label=label)
        axes.set(xlabel="spacing of the bed's spheres over their diameter")
        axes.set(
            ylabel="critical Shields number", title="An equal bead in a pocket, creeping shear"
        )
        plain(panels)
        axes.legend(frameon=False)


def _series(axes: Axes, beads: list[Row], label: str, colour: str) -> None:
    place, value, error = (
        np.array([row[key] for row in beads]) for key in ("spacing", "shields", "error")
    )
    axes.plot(place, value, "o-", ms=4, lw=1.2, mfc="white", color=colour, label=label)
    known = np.isfinite(error)
    axes.errorbar(place[known], value[known], error[known], fmt="o", ms=4, capsize=3, color=colour)


def slope_of(kind: str, spacing: np.ndarray) -> np.ndarray:
    """Tangent of the angle of repose of an equal bead behind two spheres, for spacings (n,)."""
    ahead = np.sqrt(AROUND[kind] - 0.25) * spacing
    return np.asarray(ahead / np.sqrt(1.0 - AROUND[kind] * spacing**2))


def main() -> None:
    """Gather what there is, and draw it."""
    if "--study" in sys.argv:
        for bead in STUDY:
            command = [
                sys.executable,
                str(ROOT / "demos/bead_on_substrate.py"),
                *(f"{one:g}" if isinstance(one, float) else one for one in bead),
            ]
            subprocess.run(command, check=True)
    results = [argument for argument in sys.argv[1:] if argument != "--study"]
    if results:
        store(gather(Path(results[0])))
    draw(read_rows(STORE))


if __name__ == "__main__":
    main()
