"""The picture of critical gusts: strength against duration, between the limits of long and of short ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .. import style
from ..record import drawn

_WIDE, _HIGH = 6.4, 4.6  # inches


def draw(directory: Path) -> list[Path]:
    """Draw gusts.png from the gusts.json of a directory; raises as `record.drawn`. Not collective."""
    return drawn(directory / "gusts.json", _figure, "make the search again")


def _figure(stored: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(_WIDE, _HIGH), layout="constrained")
    axes = figure.add_subplot()
    points = sorted(stored["points"], key=lambda one: one["duration"])
    duration, strength = (
        np.array([one[name] for one in points]) for name in ("duration", "strength")
    )
    errors = [one["error"] or 0.0 for one in points]
    looks: style.Looks = {"marker": "o", "color": style.FLOW, "capsize": 3}
    axes.errorbar(duration, strength, errors, label="leaves its pocket above", **looks)
    looks = {"color": style.INK, "linestyle": "--", "linewidth": 0.9}
    axes.axhline(stored["static"], label="a steady flow moves it above", **looks)
    shortest = 1.0 + (strength[0] - 1.0) * duration[0] / duration
    axes.plot(
        duration, shortest, color=style.PUSH, linestyle=":", label="impulse of the shortest gust"
    )
    axes.set(
        xscale="log", yscale="log", xlabel="duration of the gust [time]", ylabel="strength [-]"
    )
    axes.set_title(stored["title"] or "The weakest gusts that move the grain out of its pocket")
    axes.legend()
    return figure
