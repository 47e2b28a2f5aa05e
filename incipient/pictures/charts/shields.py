"""Shields' diagram: the curve of Soulsby and Whitehouse (1997), and the point of a flume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ...files import require_ending
from ...flumes.answer import FlumeAnswer
from ...flumes.thresholds import OFTEN, SELDOM, natural_bed, soulsby_whitehouse, zanke
from .. import style

LARGEST_DIAMETER = "critical Shields number (largest diameter)"
# Dimensionless diameters D* of the curve and of Zanke's table, Reynolds numbers of natural beds.
_CURVE, _TABLE = np.geomspace(1.0, 400.0, 200), np.geomspace(1.2, 1150.0, 60)
_REYNOLDS = np.geomspace(0.1, 299.0, 60)


def beside_soulsby_whitehouse(axes: Axes) -> None:
    """Draw their curve, and label the axes."""
    shields = soulsby_whitehouse(_CURVE)
    reynolds = np.sqrt(shields * _CURVE**3)
    label = "Soulsby & Whitehouse (1997)"
    axes.plot(reynolds, shields, "--", color="#858585", lw=1.2, label=label, zorder=1)
    axes.set(
        xscale="log", yscale="log", xlabel="shear Reynolds number u* d/ν", ylabel=LARGEST_DIAMETER
    )


def draw_flume(answer: FlumeAnswer, path: Path) -> None:
    """Draw the flume's Shields number among critical ones to a PNG; raises OutputError."""
    require_ending(path, ".png")
    with style.applied():
        figure, axes = style.chart("Shields number of the flume")
        beside_soulsby_whitehouse(axes)
        shields = np.array([zanke(size) for size in _TABLE], dtype=float)
        reynolds = np.sqrt(shields * _TABLE**3)
        axes.plot(reynolds, shields, ":", color=style.WEIGHT, label="Zanke (2003)")
        beds = [natural_bed(float(at)) for at in _REYNOLDS]
        for probability, line, shade in ((SELDOM, "-", 0.15), (OFTEN, "-.", 0.0)):
            medians = [bed.median(probability) for bed in beds if bed]
            errors = np.array([bed.error(probability) for bed in beds if bed])
            label = f"natural bed, motion for {100 * probability:g}% of the time"
            axes.plot(_REYNOLDS, medians, line, color=style.FLOW, label=label)
            band = (medians / (1.0 + errors), medians * (1.0 + errors))
            axes.fill_between(_REYNOLDS, *band, color=style.FLOW, alpha=shade, lw=0)
        axes.plot(
            answer.shear_reynolds, answer.shields, "o", color=style.PUSH, ms=8, label="this flume"
        )
        axes.set_ylabel("Shields number of the bed")
        axes.legend()
        style.save(figure, path)
