"""A figure that shows one stored step of a run after the other: what films in the plane and in space have in common.

Fields are shown in bands of colour, the same in all frames: bands compress many times better than shades.
"""

from __future__ import annotations

import math
import textwrap
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ...output.series_file import read_step
from ..record import StoredRun, read_scene
from ..style import GROUND, INK, View
from .film_file import DOTS, Frames
from .history import History, read_history

ARROWS, _SLOWEST = 24, 0.01  # along the longer side; of the fastest: where there is none
_SAMPLES = 2000  # nodes of each frame that colours are chosen by
_BANDS = 24
_WIDTH, _TALLEST, _NARROWEST = 7.2, 4.6, 4.4  # inches, as below
_LEFT, _RIGHT, _TOP, _BOTTOM, _LINE = 0.65, 1.05, 0.5, 0.5, 0.2


@dataclass(frozen=True)
class Field:
    """How a field is shown: its name, colours, the share [per cent] of values at either end beyond them."""

    name: str
    colours: str
    clipped: float
    symmetric: bool = False

    def values(self, run: StoredRun) -> np.ndarray:
        """(nodes,) what is shown of it."""
        stored = "velocity" if self.name == "speed" else self.name
        return self.of({stored: run.field(stored)})

    def of(self, fields: Mapping[str, np.ndarray]) -> np.ndarray:
        """What is shown, of fields by name: the speed, a scalar, or, of the vorticity in space, its part about y."""
        if self.name == "speed":
            return np.linalg.norm(fields["velocity"], axis=-1)
        values = fields[self.name]
        return values[..., 1] if self.symmetric and values.shape[-1] == 3 else values

    def levels(self, seen: np.ndarray) -> np.ndarray:
        """Limits of the bands of colour, for the values of all frames."""
        low, high = np.percentile(seen, (self.clipped, 100.0 - self.clipped))
        if self.symmetric:
            high = max(-low, high)
            low = -high
        elif self.name == "speed":
            low = 0.0
        if high - low <= 1e-12 * max(abs(low), abs(high)):
            low, high = low - 0.5, high + 0.5
        return np.asarray(MaxNLocator(_BANDS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))

    @property
    def beyond(self) -> Literal["max", "both"]:
        """At which ends of the colours there are values beyond them, in matplotlib's words."""
        return "max" if self.name == "speed" else "both"


FIELDS = {
    "velocity": Field("speed", "viridis", 0.2),
    "pressure": Field("pressure", "RdYlBu_r", 1.0),
    "vorticity": Field("vorticity", "RdBu_r", 4.0, symmetric=True),
}


class Film(Frames):
    """A figure that shows one step after the other; subclasses say which part of the run, and paint it."""

    def __init__(self, directory: Path, field: Field, indices: np.ndarray, moments: np.ndarray):
        self.directory, self.field, self.indices, self.moments = directory, field, indices, moments
        self.scene, self.count = read_scene(directory), len(indices)
        self.levels = field.levels(np.concatenate([self._sampled(k) for k in range(len(indices))]))
        self._digits = max(0, 1 - math.floor(math.log10(np.diff(moments).max())))
        bands = len(self.levels) - 1 + {"max": 1, "both": 2}[field.beyond]
        self.colours = colormaps[field.colours].resampled(bands)
        self.norm = BoundaryNorm(self.levels, bands, extend=field.beyond)
        self.view = self._whole()
        self.figure, self.axes = self._laid_out()
        self._drawn: list[Artist] = []

    def show(self, number: int) -> None:
        """Draw a frame in place of the one before."""
        for artist in self._drawn:
            artist.remove()
        run, time = self.run(number), float(self.moments[number])
        self.axes.set_title(f"{self.field.name.capitalize()}, t = {time:.{self._digits}f}", loc="left")
        self._drawn = self._shown(run, time)

    def run(self, number: int) -> StoredRun:
        """The step that a frame shows."""
        return self.stored(number)

    def stored(self, number: int) -> StoredRun:
        """The step that a frame shows, as it was stored."""
        step = read_step(self.directory / "fields", int(self.indices[number]))
        return StoredRun(self.directory, {}, self.scene, step, None)

    @abstractmethod
    def _shown(self, run: StoredRun, time: float) -> list[Artist]:
        """Draw a step; what was drawn."""

    @abstractmethod
    def _box(self) -> View:
        """The part of the plane that the fluid takes."""

    @property
    @abstractmethod
    def _upwards(self) -> str:
        """The name of the axis that is shown upwards."""

    @cached_property
    def history(self) -> History | None:
        """The way of a grain that moves."""
        return read_history(self.directory / "history.csv") if self.stored(0).moves else None

    def _sampled(self, number: int) -> np.ndarray:
        values = self.field.values(self.run(number))
        return values[:: max(1, len(values) // _SAMPLES)]

    def _whole(self) -> View:
        x0, x1, y0, y1 = self._box()
        return x0, x1, y0 - (0.04 * (y1 - y0) if self.scene.get("bed") else 0.0), y1

    def _laid_out(self) -> tuple[Figure, Axes]:
        x0, x1, y0, y1 = self.view
        up = min(_TALLEST, (_WIDTH - _LEFT - _RIGHT) * (y1 - y0) / (x1 - x0))
        across = up * (x1 - x0) / (y1 - y0)
        width = max(_NARROWEST, _LEFT + across + _RIGHT)
        heading = textwrap.wrap(self.run(0).headline, int(12 * width))[:3]
        height = _BOTTOM + up + _TOP + _LINE * len(heading)
        # Videos want an even number of dots.
        width, height = (2 * math.ceil(size * DOTS / 2) / DOTS for size in (width, height))
        figure = Figure(figsize=(width, height), dpi=DOTS)
        figure.text(_LEFT / width, 1 - 0.12 / height, "\n".join(heading), fontsize=10, va="top")
        axes = figure.add_axes((_LEFT / width, _BOTTOM / height, across / width, up / height))
        upwards = f"{self._upwards} [scene units]"
        axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x [scene units]", ylabel=upwards)
        axes.set_facecolor(GROUND)
        bar = figure.add_axes(((_LEFT + across + 0.1) / width, _BOTTOM / height, 0.13 / width, up / height))
        figure.colorbar(ScalarMappable(self.norm, self.colours), cax=bar, extendfrac=0.04)
        bar.yaxis.set_major_locator(MaxNLocator(7))
        bar.set_ylabel(f"{self.field.name} [scene units]")
        return figure, axes

    def way(self, time: float) -> list[Artist]:
        """The way of a moving grain's centre up to a time: ink on a broader white, seen on any colour."""
        if self.history is None:
            return []
        before = self.history.centres[self.history.times < time]
        centre = self.history.at(time).centre
        points = np.vstack([before, (centre[0], centre[-1])])
        lines = [
            Line2D(*points.T, color=colour, lw=width, zorder=3.5)
            for colour, width in (("white", 2.4), (INK, 1.0))
        ]
        return [self.axes.add_artist(line) for line in lines]

    def arrows(self, places: np.ndarray, velocities: np.ndarray, spacing: float) -> Artist:
        """Velocities (n, 2) at places (n, 2); as long as the root of the speed, so that slow flow is seen."""
        reached = velocities / self.levels[-1]
        speeds = np.linalg.norm(reached, axis=1)
        shown = speeds > _SLOWEST
        lengths = np.sqrt(np.minimum(speeds[shown], 1.0))
        steps = 0.9 * spacing * reached[shown] * (lengths / speeds[shown])[:, None]
        return self.axes.quiver(
            *places[shown].T, *steps.T, angles="xy", scale_units="xy", scale=1.0, pivot="mid", color="white",
            alpha=0.85, width=0.0022, headwidth=4.0, headlength=4.5, headaxislength=4.0, minlength=0.0, zorder=2,
        )  # fmt: skip
