"""Shields' diagram with the point of a flume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...files import require_ending
from ...flumes.answer import FlumeAnswer
from ...flumes.thresholds import OFTEN, SELDOM, natural_bed, zanke
from .. import style
from .sweep_axes import beside_soulsby_whitehouse

_DIMENSIONLESS = np.geomspace(1.2, 1150.0, 60)  # D* of Zanke's table
_REYNOLDS = np.geomspace(0.1, 299.0, 60)


def draw(answer: FlumeAnswer, path: Path) -> None:
    """Draw the flume's Shields number among critical ones to a PNG; raises OutputError. Not collective."""
    require_ending(path, ".png")
    with style.applied():
        figure = Figure(figsize=(6.4, 4.6), layout="constrained")
        axes = figure.add_subplot()
        beside_soulsby_whitehouse(axes)
        shields = np.array([zanke(size) for size in _DIMENSIONLESS], dtype=float)
        reynolds = np.sqrt(shields * _DIMENSIONLESS**3)
        axes.plot(reynolds, shields, ":", color=style.WEIGHT, label="Zanke (2003)")
        beds = [natural_bed(float(at)) for at in _REYNOLDS]
        for probability, looks in ((SELDOM, "-"), (OFTEN, "-.")):
            medians = [bed.median(probability) for bed in beds if bed]
            errors = np.array([bed.error(probability) for bed in beds if bed])
            label = f"computed natural bed, {100 * probability:g}% of the time"
            axes.plot(_REYNOLDS, medians, looks, color=style.FLOW, label=label)
            if probability == SELDOM:
                band = (medians / (1.0 + errors), medians * (1.0 + errors))
                axes.fill_between(_REYNOLDS, *band, color=style.FLOW, alpha=0.15, lw=0)
        point = answer.shear_reynolds, answer.shields
        axes.plot(*point, "o", color=style.PUSH, ms=8, label="this flume")
        axes.set_ylabel("Shields number of the bed")
        axes.legend()
        style.save(figure, path)
