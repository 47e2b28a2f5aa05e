"""y+ and friction along the walls of a turbulent flow."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..planning.wall_law import WallLaw
from .record import StoredRun
from .style import FLOW, GROUND, INK, PUSH

_COLOURS = (FLOW, PUSH, INK)
LEAST = 0.1  # y+ from which on resolved walls are drawn
_SIZE = (9.0, 5.5)  # inches


def has_walls(run: StoredRun) -> bool:
    """Whether a run's result has numbers along its walls."""
    return bool((run.result.get("turbulence") or {}).get("along"))


def picture(run: StoredRun) -> Figure:
    """y+ with the range that the model of the walls requires, above the signed friction."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    figure.suptitle(run.headline)
    upper, lower = figure.subplots(2, 1, sharex=True)
    walls = run.result["turbulence"]
    resolved = walls.get("model") == "k-omega-sst"  # results of earlier versions have no model
    bounds = (LEAST, walls.get("thickest", 2.5)) if resolved else _bounds(walls)
    label = "walls are resolved" if resolved else "the law of the wall holds"
    upper.axhspan(*bounds, color=GROUND, alpha=0.3, label=label)
    if (limit := walls.get("on_sand")) and limit != bounds[1]:
        upper.axhline(limit, color=GROUND, linestyle=":", label="limit on rough walls")
    lower.axhline(0.0, color=GROUND)
    for colour, (name, profile) in zip(_COLOURS, walls["along"].items(), strict=False):
        for axes, column in ((upper, "y_plus"), (lower, "friction")):
            axes.plot(profile["x"], profile[column], ".", markersize=2, color=colour, label=name)
    upper.set(
        yscale="log",
        ylabel="y+ of the wall" if not resolved else "y+ of the first cells",
        title="Along the walls",
    )
    lower.set(xlabel="x [scene units]", ylabel="friction 2 tau/V\u00b2")
    upper.legend(loc="best")
    return figure


def _bounds(walls: dict[str, Any]) -> tuple[float, float]:
    """Range of y+ at the walls' distance in which the law holds; (1, 1) if it never holds."""
    viscosity, distance = walls["viscosity"], walls["distance"]
    law, y_plus = WallLaw(walls.get("roughness", 0.0)), np.geomspace(1.0, 1e9, 9001)
    holds = law.holds(
        y_plus * viscosity / distance, viscosity, distance, walls.get("reach", np.inf)
    )
    return tuple(y_plus[holds][[0, -1]]) if holds.any() else (y_plus[0], y_plus[0])
