"""A run in motion: a field of the flow at the steps that were stored; of a 3-D run in the plane of the grain.

Fields are shown in bands of colour, the same in all frames: bands compress many times better than shades.
"""

from __future__ import annotations

import math
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator
from PIL import Image

from ..errors import OutputError
from ..files import replaced
from ..geometry.placement import Placement
from ..output.series_file import read_step, times
from ..scene import Scene
from . import style
from .contact_forces import contact_forces
from .flow import PRESSURE, SPEED, VORTICITY, Shown, sample
from .history import read_history
from .mesh import curve
from .outlines import spoke
from .record import StoredRun, parsed_json, read_scene
from .section import draw_outlines, section_of, views_of
from .style import GRAIN, GROUND, INK, View

FIELDS = {"velocity": SPEED, "pressure": PRESSURE, "vorticity": VORTICITY}
_MOST_FRAMES = 200
_SECONDS, _RATES = 8.0, (4, 20)  # about how long a film takes, and frames per second
_DOTS, _DOTS_OF_GIF, _COLOURS = 100, 80, 128  # per inch; of a GIF, which stores each frame whole
_ARROWS, _SLOWEST = 24, 0.01  # along the longer side; of the fastest: where there is none
_SAMPLES = 2000  # nodes of each frame that colours are chosen by
_BANDS = 24
_POINTS = 320  # of the grid of a section, along its longer side


def animate(directory: Path, target: Path | None = None, field: str = "velocity") -> Path:
    """Show a field of a run in motion; returns the file written. Not collective.

    `target` ends in .gif or .mp4; by default it is DIRECTORY/FIELD.gif. Every stored step is a frame, or 200 of
    them, evenly spaced in time. The result need not be there: a run may be watched while it goes on.

    Raises:
        OutputError: with fewer than two steps, without ffmpeg for an MP4, or when it cannot be written.
    """
    path = target or directory / f"{field}.gif"
    _check(path)
    indices, moments = _frames(directory / "fields")
    rate = int(np.clip(len(indices) / _SECONDS, *_RATES))
    unfinished = path.with_name(f"{path.stem}.part{path.suffix}")
    failures = (subprocess.CalledProcessError, RuntimeError, ValueError)
    with style.applied():
        film = _Film(directory, FIELDS[field], indices, moments)
        with replaced(path, unfinished, failures) as part:
            part.touch()
            _write(film, part, rate)
    return path


def _check(path: Path) -> None:
    """Refuse a name that is not one of a film, and MP4 where there is no ffmpeg."""
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise OutputError(f"{path}: is not a name for an animation; let it end in .gif or .mp4")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise OutputError(
            f"{path}: MP4 needs ffmpeg, which is not installed; install it or write a .gif"
        )


def _frames(stem: Path) -> tuple[np.ndarray, np.ndarray]:
    """Indices and times of the steps to show: those closest to evenly spaced times."""
    stored = np.array(times(stem))
    if len(stored) < 2:
        remedy = "run the scene with [time] and --set output.every=1"
        raise OutputError(f"{stem}: holds a single step; {remedy}")
    if len(stored) <= _MOST_FRAMES:
        return np.arange(len(stored)), stored
    wanted = np.linspace(stored[0], stored[-1], _MOST_FRAMES)
    middles = 0.5 * (stored[1:] + stored[:-1])
    indices = np.unique(np.searchsorted(middles, wanted))
    return indices, stored[indices]


class _GifWriter(PillowWriter):
    """Writes a GIF whose frames share one palette, without dithering: half as large."""

    _frames: list[Image.Image]

    def finish(self) -> None:
        """Write the frames."""
        frames = [frame.convert("RGB") for frame in self._frames]
        palette = frames[-1].quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
        self._frames = [
            frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
        ]
        super().finish()


def _write(film: _Film, path: Path, rate: int) -> None:
    if path.suffix.lower() == ".mp4":
        extra = ["-crf", "20", "-movflags", "+faststart"]
        writer: Any = FFMpegWriter(fps=rate, codec="h264", extra_args=extra)
        dots = _DOTS
    else:
        writer, dots = _GifWriter(fps=rate), _DOTS_OF_GIF
    with writer.saving(film.figure, str(path), dots):
        for number in range(len(film.moments)):
            film.show(number)
            style.show_as_written(film.figure)
            writer.grab_frame()


class _Film:
    """A figure that shows one step after the other."""

    def __init__(self, directory: Path, field: Shown, indices: np.ndarray, moments: np.ndarray):
        self.directory, self.field, self.indices, self.moments = directory, field, indices, moments
        self.scene = read_scene(directory)
        first = self.run(0)
        self.in_space = first.in_space
        self.size = first.model.grain.size if self.scene.get("body") else 1.0
        self.history = read_history(directory / "history.csv") if first.moves else None
        contact = first.model.contact if first.moves else None
        self.contacts = contact_forces(directory, contact)
        self.levels = self._levels()
        self.norm = BoundaryNorm(self.levels, 256, extend="both")
        self.view = self._view(first)
        self.figure, (self.axes,) = style.panels([self.view], first.headline, self._upwards)
        width, height = (
            2 * math.ceil(s * _DOTS / 2) / _DOTS for s in self.figure.get_size_inches()
        )
        self.figure.set_size_inches(width, height)  # videos want an even number of dots
        bar = self.figure.colorbar(ScalarMappable(self.norm, field.colours), ax=self.axes)
        bar.set_label(f"{field.name} [scene units]")
        self._digits = max(0, 1 - math.floor(math.log10(np.diff(moments).max())))

    @property
    def _upwards(self) -> str:
        return "z" if self.in_space else "y"

    def run(self, number: int) -> StoredRun:
        """The step that a frame shows."""
        step = read_step(self.directory / "fields", int(self.indices[number]))
        return StoredRun(self.directory, {}, self.scene, step, None)

    def _values(self, stored: np.ndarray) -> np.ndarray:
        """What is shown of a field; of the vorticity in 3-D its part about y."""
        values = self.field.values(stored)
        return (
            values[..., 1]
            if values.ndim > 1 and self.field is VORTICITY and values.shape[-1] == 3
            else values
        )

    def _levels(self) -> np.ndarray:
        """Limits of the bands of colour, for the values of all frames."""
        sampled = []
        for number in range(len(self.moments)):
            values = self._values(self.run(number).field(self.field.stored))
            sampled.append(values[:: max(1, len(values) // _SAMPLES)])
        norm = self.field.limits(np.concatenate(sampled))
        ticks = MaxNLocator(_BANDS, steps=[1, 2, 2.5, 5, 10])
        return np.asarray(ticks.tick_values(norm.vmin or 0.0, norm.vmax or 0.0))

    def _view(self, first: StoredRun) -> View:
        if self.in_space:
            return views_of(first)[0]
        x0, x1, y0, y1 = first.box
        if first.setting("domain", "top") == "free-surface":  # it rises above where it began
            y1 = max(self.run(number).box[3] for number in range(len(self.moments)))
        return x0, x1, y0 - (0.04 * (y1 - y0) if self.scene.get("bed") else 0.0), y1

    def show(self, number: int) -> None:
        """Draw a frame instead of the one before."""
        run, time, axes = self.run(number), float(self.moments[number]), self.axes
        axes.clear()
        axes.set(xlim=self.view[:2], ylim=self.view[2:], aspect="equal", facecolor=GROUND)
        axes.set(xlabel="x [scene units]", ylabel=f"{self._upwards} [scene units]")
        axes.set_title(f"{self.field.name.capitalize()}, t = {time:.{self._digits}f}", loc="left")
        (self._show_section if self.in_space else self._show_plane)(axes, run, time)
        if self.history is not None:
            before = self.history.centres[self.history.times < time]
            centre = self.history.at(time).centre
            points = np.vstack([before, (centre[0], centre[-1])])
            for colour, width in (("white", 2.4), (INK, 1.0)):  # seen on any colour
                axes.plot(*points.T, color=colour, lw=width, zorder=3.5)
        if self.contacts is not None:
            self.contacts.draw(axes, time, self.size)
        axes.set(xlim=self.view[:2], ylim=self.view[2:])

    def _show_plane(self, axes: Axes, run: StoredRun, time: float) -> None:
        """All cells, the boundary of the fluid, the grain with a spoke that shows how it is turned."""
        values = self._values(run.field(self.field.stored))
        looks: dict[str, Any] = {
            "levels": self.levels,
            "cmap": self.field.colours,
            "norm": self.norm,
        }
        axes.tricontourf(run.mesh.triangulation, values, extend="both", zorder=1, **looks)
        outer, *holes = (curve(run.mesh.points, loop) for loop in run.mesh.loops)
        axes.add_artist(Polygon(outer, fill=False, edgecolor=INK, lw=0.8, zorder=3))
        for hole in holes:
            axes.add_artist(Polygon(hole, facecolor=GRAIN, edgecolor=INK, lw=1.0, zorder=3))
        if holes and self.history is not None:
            ends = spoke(holes[0], self.history.at(time))
            looks = {"color": INK, "lw": 1.0, "marker": "o", "markevery": [0], "ms": 2.5}
            axes.add_artist(Line2D(*ends.T, zorder=4, **looks))
        if self.field is SPEED:
            x, y, velocity = sample(run.mesh, run.field("velocity")[:, :2], run.box, _ARROWS)
            self._arrows(axes, x, y, velocity)

    def _show_section(self, axes: Axes, run: StoredRun, time: float) -> None:
        """The plane through the grain, which is where it is at the time."""
        if (place := self._place(time)) is not None:
            grain = {"computed_centre": place.centre, "quaternion": place.quaternion}
            run = replace(run, result={"grain": grain | {"size": self.size}})
        section = section_of(run, self.view, sorted({"velocity", self.field.stored}), _POINTS)
        values = self._values(section.fields[self.field.stored])
        looks: style.Looks = {"cmap": self.field.colours, "norm": self.norm}
        image = axes.imshow(
            values, origin="lower", extent=section.view, zorder=1, interpolation="bilinear", **looks
        )
        draw_outlines(axes, section, image)
        if self.field is SPEED:
            every = max(1, max(section.inside.shape) // _ARROWS)
            kept = (slice(every // 2, None, every),) * 2
            velocity = section.fields["velocity"][kept][..., [0, 2]].transpose(2, 0, 1)
            outside = np.broadcast_to(~section.inside[kept], velocity.shape)
            arrows: Any = np.ma.masked_array(velocity, outside)
            self._arrows(axes, section.x[kept[1]], section.z[kept[0]], arrows)

    def _arrows(
        self, axes: Axes, x: np.ndarray, y: np.ndarray, velocity: np.ma.MaskedArray
    ) -> None:
        """Velocities (2, rows, columns); as long as the root of the speed, so that slow flow is seen."""
        reached = velocity / self.levels[-1]
        speeds = np.ma.masked_less(np.linalg.norm(reached, axis=0), _SLOWEST)
        steps = 0.9 * (x[1] - x[0]) * reached / np.sqrt(np.maximum(speeds, speeds**2))
        axes.quiver(
            x, y, *steps, angles="xy", scale_units="xy", scale=1.0, pivot="mid", color="white", alpha=0.85,
            width=0.0022, headwidth=4.0, headlength=4.5, headaxislength=4.0, minlength=0.0, zorder=2,
        )  # fmt: skip

    def _place(self, time: float) -> Placement | None:
        """Where the grain is: by its history, else where the mesh was made for it, else where the scene puts it."""
        if not self.scene.get("body"):
            return None
        if self.history is not None:
            return self.history.at(time)
        try:
            grain = parsed_json(self.directory / "result.json")["grain"]
            return Placement(tuple(grain["computed_centre"]), quaternion=tuple(grain["quaternion"]))
        except (OutputError, KeyError, TypeError):  # the run goes on
            return Scene(**self.scene).placement
