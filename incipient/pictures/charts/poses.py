"""The picture of a grain in many poses: the fraction that moves, against the Shields number."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .. import style
from ..record import drawn


def draw(directory: Path) -> list[Path]:
    """Draw poses.png from the poses.json of a directory; raises as `record.drawn`. Not collective."""
    return drawn(directory / "poses.json", _figure, "survey the grain again")


def _figure(stored: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    shields = [math.inf if one is None else one for one in stored["shields"]]
    fractions = np.arange(1, len(shields) + 1) / max(len(shields), 1)
    axes.step(shields, fractions, where="post", color=style.FLOW)
    axes.set(xlabel="Shields number with the nominal diameter", ylabel="fraction of poses")
    axes.set_title(f"{len(shields)} thresholds of {stored['poses']} poses")
    return figure
