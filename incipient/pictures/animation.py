"""A run in motion: one field of the flow at the steps that were stored, as GIF or, with ffmpeg, as MP4.

Fields are shown in bands of colour, the same in all frames: bands compress many times better than shades.
"""

from __future__ import annotations

import math
import subprocess
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.animation import FFMpegWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator

from ..errors import OutputError
from ..files import reported
from ..output.series_file import read_step, times
from . import style
from .history import History, read_history
from .mesh import curve, triangles_of
from .record import Run, read_scene
from .style import GRAIN, GROUND, INK, View
from .trajectory import spoke

if TYPE_CHECKING:
    from PIL.Image import Image

_MOST_FRAMES = 200
_SECONDS, _RATES = 8.0, (4, 20)  # about how long it takes, and frames per second
_SAMPLES = 2000  # nodes of each frame that colours are chosen by
_BANDS = 24
_PALETTE, _AS_GOOD_AS_WHITE = 128, 247  # colours of a GIF; least part of red, green and blue
_ARROWS, _SLOWEST = 24, 0.01  # along the longer side; of the fastest: where there is none
_WIDTH, _TALLEST, _NARROWEST, _DOTS = 7.2, 4.6, 4.4, 100  # inches, dots per inch
_LEFT, _RIGHT, _TOP, _BOTTOM, _LINE = 0.65, 1.05, 0.5, 0.5, 0.2


@dataclass(frozen=True)
class Field:
    """How a field is shown: its name, colours, the share [per cent] of values at either end beyond them."""

    name: str
    colours: str
    clipped: float
    symmetric: bool = False

    def values(self, run: Run) -> np.ndarray:
        """(nodes,) what is shown of it."""
        values = run.field("velocity" if self.name == "speed" else self.name)
        return np.linalg.norm(values, axis=1) if values.ndim == 2 else values

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


def animate(directory: Path, target: Path | None = None, field: str = "velocity") -> Path:
    """Show a field of a run in motion; returns the file written. Not collective.

    `target` ends in .gif or .mp4; by default it is DIRECTORY/FIELD.gif. Every stored step is a frame, or 200 of
    them, evenly spaced in time. The result need not be there: a run may be watched while it goes on.

    Raises:
        OutputError: with a scene in space or fewer than two steps, without ffmpeg for an MP4, or when it cannot be
            written.
    """
    path = target or directory / f"{field}.gif"
    _check(path)
    known = (directory / "scene.toml").exists()
    if known and (read_scene(directory).get("domain") or {}).get("width") is not None:
        raise OutputError(
            f"{directory}: flow in space is not animated by this version; see trajectory.png with `incipient show`, "
            "and fields.xdmf in ParaView"
        )
    indices, moments = _frames(directory / "fields")
    rate = int(np.clip(len(indices) / _SECONDS, *_RATES))
    with style.applied():
        film = _Film(directory, FIELDS[field], indices, moments)
        with _finished(path) as part:
            (_write_mp4 if path.suffix.lower() == ".mp4" else _write_gif)(film, part, rate)
    return path


def _check(path: Path) -> None:
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise OutputError(f"{path}: is not a name for an animation; let it end in .gif or .mp4")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise OutputError(f"{path}: MP4 needs ffmpeg, which is not installed; install it or write a .gif")


def _frames(stem: Path) -> tuple[np.ndarray, np.ndarray]:
    """Indices and times of the steps to show: those closest to evenly spaced times."""
    stored = np.array(times(stem))
    if len(stored) < 2:
        raise OutputError(
            f"{stem}.h5: holds a single step; run the scene with [time] and --set output.every=1"
        )
    wanted = np.linspace(stored[0], stored[-1], min(len(stored), _MOST_FRAMES))
    after = np.clip(np.searchsorted(stored, wanted), 1, len(stored) - 1)
    nearest = np.where(wanted - stored[after - 1] < stored[after] - wanted, after - 1, after)
    if len(stored) <= _MOST_FRAMES:
        nearest = np.arange(len(stored))
    indices = np.unique(nearest)
    return indices, stored[indices]


# -- files -------------------------------------------------------------------------------------------------


@contextmanager
def _finished(path: Path) -> Iterator[Path]:
    """A name to write to, which becomes `path` if nothing goes wrong."""
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    with reported(path, (subprocess.CalledProcessError, RuntimeError, ValueError)):
        try:
            part.touch()
            yield part
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def _write_gif(film: _Film, path: Path, rate: int) -> None:
    """All frames with one palette, chosen from some of them, and without dithering: smaller, and calm."""
    from PIL import Image

    count = len(film.indices)
    chosen = [film.frame(k) for k in sorted({0, count // 3, 2 * count // 3, count - 1})]
    palette = Image.fromarray(np.vstack([np.asarray(image) for image in chosen])).quantize(_PALETTE)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > _AS_GOOD_AS_WHITE] = 255
    palette.putpalette(colours.ravel().tolist())
    dither = Image.Dither.NONE
    first, *others = (film.frame(k).quantize(palette=palette, dither=dither) for k in range(count))
    first.save(path, "GIF", save_all=True, append_images=others, duration=1000 // rate, loop=0)


def _write_mp4(film: _Film, path: Path, rate: int) -> None:
    writer = FFMpegWriter(fps=rate, codec="h264", extra_args=["-crf", "20", "-movflags", "+faststart"])
    with writer.saving(film.figure, path, _DOTS):
        for k in range(len(film.indices)):
            film.show(k)
            writer.grab_frame()


# -- frames ------------------------------------------------------------------------------------------------


class _Film:
    """A figure that shows one step after the other."""

    def __init__(self, directory: Path, field: Field, indices: np.ndarray, moments: np.ndarray):
        self.directory, self.field, self.indices, self.moments = directory, field, indices, moments
        self._scene = read_scene(directory)
        self._levels = field.levels(np.concatenate([self._sampled(k) for k in range(len(indices))]))
        self._digits = max(0, 1 - math.floor(math.log10(np.diff(moments).max())))
        bands = len(self._levels) - 1 + {"max": 1, "both": 2}[field.beyond]
        self._colours = colormaps[field.colours].resampled(bands)
        self._norm = BoundaryNorm(self._levels, bands, extend=field.beyond)
        self._view = self._whole()
        self.figure, self._axes = self._laid_out()
        self._canvas = FigureCanvasAgg(self.figure)
        self._drawn: list[Artist] = []

    def frame(self, number: int) -> Image:
        """A frame as an RGB picture."""
        from PIL import Image

        self.show(number)
        self._canvas.draw()
        return Image.fromarray(np.asarray(self._canvas.buffer_rgba())[:, :, :3])

    def show(self, number: int) -> None:
        """Draw a frame in place of the one before."""
        for artist in self._drawn:
            artist.remove()
        run, time = self._run(number), float(self.moments[number])
        self._axes.set_title(f"{self.field.name.capitalize()}, t = {time:.{self._digits}f}", loc="left")
        self._drawn = [self._painted(run), *self._solids(run), *self._course(run, time)]
        if self.field.name == "speed":
            self._drawn.append(self._arrows(run))

    def _run(self, number: int) -> Run:
        step = read_step(self.directory / "fields", int(self.indices[number]))
        return Run(self.directory, {}, self._scene, step, None)

    def _sampled(self, number: int) -> np.ndarray:
        values = self.field.values(self._run(number))
        return values[:: max(1, len(values) // _SAMPLES)]

    @cached_property
    def _history(self) -> History | None:
        """The way of a grain that moves."""
        return read_history(self.directory / "history.csv") if self._run(0).moves else None

    # -- what stays ------------------------------------------------------------------------------

    def _whole(self) -> View:
        x0, x1, y0, y1 = self._run(0).box
        return x0, x1, y0 - (0.04 * (y1 - y0) if self._scene.get("bed") else 0.0), y1

    def _laid_out(self) -> tuple[Figure, Axes]:
        x0, x1, y0, y1 = self._view
        up = min(_TALLEST, (_WIDTH - _LEFT - _RIGHT) * (y1 - y0) / (x1 - x0))
        across = up * (x1 - x0) / (y1 - y0)
        width = max(_NARROWEST, _LEFT + across + _RIGHT)
        heading = textwrap.wrap(self._run(0).headline, int(12 * width))[:3]
        height = _BOTTOM + up + _TOP + _LINE * len(heading)
        width, height = (
            2 * math.ceil(size * _DOTS / 2) / _DOTS for size in (width, height)
        )  # videos want even
        figure = Figure(figsize=(width, height), dpi=_DOTS)
        figure.text(_LEFT / width, 1 - 0.12 / height, "\n".join(heading), fontsize=10, va="top")
        axes = figure.add_axes((_LEFT / width, _BOTTOM / height, across / width, up / height))
        axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x [scene units]", ylabel="y [scene units]")
        axes.set_facecolor(GROUND)
        bar = figure.add_axes(((_LEFT + across + 0.1) / width, _BOTTOM / height, 0.13 / width, up / height))
        figure.colorbar(ScalarMappable(self._norm, self._colours), cax=bar, extendfrac=0.04)
        bar.yaxis.set_major_locator(MaxNLocator(7))
        bar.set_ylabel(f"{self.field.name} [scene units]")
        return figure, axes

    # -- what changes ----------------------------------------------------------------------------

    def _painted(self, run: Run) -> Artist:
        triangles = triangles_of(run.mesh.points, run.mesh.quarters)
        return self._axes.tricontourf(
            triangles, self.field.values(run), levels=self._levels, cmap=self._colours, norm=self._norm,
            extend=self.field.beyond, zorder=1,
        )  # fmt: skip

    def _solids(self, run: Run) -> list[Artist]:
        """The boundary of the fluid and the grains in it."""
        outer, *holes = (curve(run.mesh.points, loop) for loop in run.mesh.loops)
        drawn = [Polygon(outer, fill=False, edgecolor=INK, lw=0.8, zorder=3)]
        drawn += [Polygon(hole, facecolor=GRAIN, edgecolor=INK, lw=1.0, zorder=3) for hole in holes]
        return [self._axes.add_artist(patch) for patch in drawn]

    def _course(self, run: Run, time: float) -> list[Artist]:
        """The way of a moving grain's centre so far, and a spoke that shows how it is turned."""
        if self._history is None:
            return []
        history = self._history
        placement = history.at(time)
        way = np.vstack([history.centres[history.times < time], placement.centre])
        # Ink on a broader white: seen on any colour, and on the grain.
        looks = (("white", 2.4), (INK, 1.0))
        drawn = [Line2D(*way.T, color=colour, lw=width, zorder=3.5) for colour, width in looks]
        if len(run.mesh.loops) > 1:
            axis = spoke(curve(run.mesh.points, run.mesh.loops[1]), placement)
            drawn.append(Line2D(*axis.T, color=INK, lw=1.0, marker="o", markevery=[0], ms=2.5, zorder=4))
        return [self._axes.add_artist(line) for line in drawn]

    def _arrows(self, run: Run) -> Artist:
        """The flow on a regular grid; arrows are as long as the root of the speed, so that slow flow is seen."""
        from scipy.spatial import KDTree

        x0, x1, y0, y1 = run.box
        spacing = max(x1 - x0, y1 - y0) / _ARROWS
        grid = np.meshgrid(np.arange(x0 + spacing / 2, x1, spacing), np.arange(y0 + spacing / 2, y1, spacing))
        places = np.column_stack([one.ravel() for one in grid])
        places = places[_in_fluid(run, places)]
        distances, nodes = KDTree(run.mesh.points).query(places, k=3)
        weights = 1.0 / np.maximum(distances, 1e-9 * spacing)
        weights /= weights.sum(axis=1, keepdims=True)
        velocities = np.einsum("nk,nkd->nd", weights, run.field("velocity")[nodes, :2])
        reached = velocities / self._levels[-1]
        speeds = np.linalg.norm(reached, axis=1)
        shown = speeds > _SLOWEST
        lengths = np.sqrt(np.minimum(speeds[shown], 1.0))
        steps = 0.9 * spacing * reached[shown] * (lengths / speeds[shown])[:, None]
        return self._axes.quiver(
            *places[shown].T, *steps.T, angles="xy", scale_units="xy", scale=1.0, pivot="mid", color="white",
            alpha=0.85, width=0.0022, headwidth=4.0, headlength=4.5, headaxislength=4.0, minlength=0.0, zorder=2,
        )  # fmt: skip


def _in_fluid(run: Run, places: np.ndarray) -> np.ndarray:
    """(n,) whether places lie inside the outer boundary and outside the grains."""
    outer, *holes = (Outline(curve(run.mesh.points, loop, 2)) for loop in run.mesh.loops)
    inside = outer.contains_points(places)
    for hole in holes:
        inside &= ~hole.contains_points(places)
    return inside
