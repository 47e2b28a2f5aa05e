"""Figures of the documentation, in the style of the program's own pictures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from tables import DOCS

from incipient.pictures import style

FIGURES = DOCS / "figures"


@contextmanager
def drawn(
    target: Path, size: tuple[float, float], rows: int = 1, columns: int = 1, **grid: Any
) -> Iterator[tuple[Figure, np.ndarray]]:
    """A figure of a size [inches] and its panels (rows, columns); saved when they are drawn.

    grid: arguments of `Figure.subplots`
    """
    with style.applied(), rc_context({"text.parse_math": True}):
        figure = Figure(figsize=size, layout="constrained")
        yield figure, figure.subplots(rows, columns, squeeze=False, **grid)
        target.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(target, dpi=style.DOTS_PER_INCH)


def plain(panels: np.ndarray) -> None:
    """Panels without frames, over a grid."""
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
