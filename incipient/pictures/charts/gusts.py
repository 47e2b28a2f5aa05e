"""The picture of critical gusts: strength against duration, between the limits of long and of short ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import OutputError
from .. import style
from ..record import parsed_json

_WIDE, _HIGH = 6.4, 4.6  # inches


def draw(directory: Path) -> list[Path]:
    """Draw gusts.png from the gusts.json of a directory. Not collective.

    Raises:
        OutputError: when it is missing or damaged, or the picture cannot be written.
    """
    source, path = directory / "gusts.json", directory / "gusts.png"
    stored = parsed_json(source)
    with style.applied():
        try:
            figure = _figure(stored)
        except (KeyError, TypeError, ValueError) as error:
            raise OutputError(f"{source}: cannot be understood ({error}); make the search again") from error
        style.save(figure, path)
    return [path]


def _figure(stored: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(_WIDE, _HIGH), layout="constrained")
    axes = figure.add_subplot()
    points = sorted(stored["points"], key=lambda one: one["duration"])
    duration, strength = (np.array([one[name] for one in points]) for name in ("duration", "strength"))
    errors = [one["error"] or 0.0 for one in points]
    axes.errorbar(
        duration, strength, errors, marker="o", color=style.FLOW, capsize=3, label="leaves its pocket above"
    )
    axes.axhline(
        stored["static"], color=style.INK, linestyle="--", linewidth=0.9, label="a steady flow moves it above"
    )
    shortest = 1.0 + (strength[0] - 1.0) * duration[0] / duration
    axes.plot(duration, shortest, color=style.PUSH, linestyle=":", label="impulse of the shortest gust")
    axes.set(xscale="log", yscale="log", xlabel="duration of the gust [time]", ylabel="strength [-]")
    axes.set_title(stored["title"] or "The weakest gusts that move the grain out of its pocket")
    axes.legend()
    return figure
