"""y+ and friction along the walls of a turbulent flow."""

from __future__ import annotations

from matplotlib.figure import Figure

from .record import StoredRun
from .style import FLOW, GROUND, INK, PUSH

_COLOURS = (FLOW, PUSH, INK)
_SIZE = (9.0, 5.5)  # inches


def has_walls(run: StoredRun) -> bool:
    """Whether a result has quantities along walls."""
    return bool((run.result.get("turbulence") or {}).get("along"))


def picture(run: StoredRun) -> Figure:
    """y+ above, signed friction below."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    figure.suptitle(run.headline)
    upper, lower = figure.subplots(2, 1, sharex=True)
    walls = run.result["turbulence"]
    lower.axhline(0.0, color=GROUND)
    for colour, (name, profile) in zip(_COLOURS, walls["along"].items(), strict=False):
        for axes, column in ((upper, "y_plus"), (lower, "friction")):
            axes.plot(profile["x"], profile[column], ".", markersize=2, color=colour, label=name)
    upper.set(
        yscale="log",
        ylabel="y+ of the wall",
        title="Along the walls",
    )
    lower.set(xlabel="x [scene units]", ylabel="friction 2 tau/V\u00b2")
    upper.legend(loc="best")
    return figure
