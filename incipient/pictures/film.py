"""Animation of a field over the stored steps, with the same colours in all frames."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from ..errors import OutputError
from ..files import replaced
from ..output.series_file import read_step, times
from . import style
from .flow import PRESSURE, SPEED, VORTICITY, Shown
from .plane import seen_from_the_side
from .record import StoredRun, parsed_json, scene_of
from .style import INK
from .trajectory import contact_forces, read_history

FIELDS = {"velocity": SPEED, "pressure": PRESSURE, "vorticity": VORTICITY}
_MOST_FRAMES = 200
_DOTS = {".gif": 80, ".mp4": 100}  # per inch; a GIF stores each frame whole
_ARROWS = 24  # along the longer side


def animate(directory: Path, target: Path | None = None, field: str = "velocity") -> Path:
    """Animate a field of a run, finished or not; returns the file written.

    `target` ends in .gif or .mp4; by default it is DIRECTORY/FIELD.gif. Raises OutputError with fewer than two
    steps, without ffmpeg for an MP4, or when it cannot be written.
    """
    path = target or directory / f"{field}.gif"
    ending = path.suffix.lower()
    if ending not in _DOTS:
        raise OutputError(f"{path}: is not a name for an animation; let it end in .gif or .mp4")
    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        raise OutputError(
            f"{path}: MP4 needs ffmpeg, which is not installed; install it or write a .gif"
        )
    indices, moments = _frames(directory / "fields")
    rate = int(np.clip(len(indices) / 8.0, 4, 20))  # frames per second, for about 8 seconds
    unfinished = path.with_name(f"{path.stem}.part{path.suffix}")
    failures = (subprocess.CalledProcessError, RuntimeError, ValueError)
    with style.applied():
        film = _Film(directory, FIELDS[field], indices, moments)
        with replaced(path, unfinished, failures) as part:
            part.touch()
            writer = FFMpegWriter(rate) if ending == ".mp4" else PillowWriter(rate)
            FuncAnimation(
                film.figure, film.show, frames=len(moments), init_func=list,
                cache_frame_data=False,
            ).save(part, writer, dpi=_DOTS[ending])  # fmt: skip
    return path


def _frames(stem: Path) -> tuple[np.ndarray, np.ndarray]:
    stored = np.array(times(stem))
    if len(stored) < 2:
        raise OutputError(
            f"{stem}: holds a single step; run the scene with [time] and --set output.every=1"
        )
    if len(stored) <= _MOST_FRAMES:
        return np.arange(len(stored)), stored
    wanted = np.linspace(stored[0], stored[-1], _MOST_FRAMES)
    indices = np.unique(np.searchsorted(0.5 * (stored[1:] + stored[:-1]), wanted))
    return indices, stored[indices]


class _Film:
    def __init__(self, directory: Path, field: Shown, indices: np.ndarray, moments: np.ndarray):
        self.directory, self.field, self.indices, self.moments = directory, field, indices, moments
        self.scene, self.history = scene_of(directory), None
        result = directory / "result.json"
        self.result = parsed_json(result) if result.exists() else {}
        if self.scene.moves:
            self.history = read_history(directory / "history.csv")
        self.size = 1.0 if self.scene.grain is None else self.scene.grain.size
        self.contacts = contact_forces(directory, self.scene.contact) if self.history else None
        first = self.run(0)
        self.norm, top = self._ranges()
        self.levels = np.linspace(self.norm.vmin or 0.0, self.norm.vmax or 0.0, 17)
        x0, x1, y0, y1 = first.views[0]
        self.view = (x0, x1, y0, max(y1, top))  # a free surface rises above where it began
        self.figure, (self.axes,) = style.panels([self.view], first.headline, first.plane.upwards)
        self.figure.colorbar(
            ScalarMappable(self.norm, field.colours), ax=self.axes, extend="both",
            label=f"{field.name} [scene units]",
        )  # fmt: skip
        self._digits = max(0, 1 - math.floor(math.log10(np.diff(moments).max())))

    def run(self, number: int) -> StoredRun:
        step = read_step(self.directory / "fields", int(self.indices[number]))
        result = self.result
        if self.history is not None:
            place = self.history.at(float(self.moments[number]))
            grain = {"quaternion": place.quaternion, "angle": place.angle}
            result = {"grain": {"computed_centre": place.centre, **grain}}
        return StoredRun(self.directory, result, self.scene, step, None)

    def _ranges(self) -> tuple[Normalize, float]:
        """Limits of the colours, and the highest point, of all frames."""
        sampled, tops = [], []
        for run in map(self.run, range(len(self.moments))):
            values = self.field.values(run.field(self.field.stored))
            sampled.append(values[:: max(1, len(values) // 2000)])  # enough to choose colours
            tops.append(run.fields.points[:, -1 if run.in_space else 1].max())
        return self.field.limits(np.concatenate(sampled)), max(tops)

    def show(self, number: int) -> list[Artist]:
        run, time, axes = self.run(number), float(self.moments[number]), self.axes
        plane, values = run.plane, self.field.values(run.in_plane(self.field.stored))
        axes.clear()
        axes.set(aspect="equal", xlabel="x [scene units]", ylabel=f"{plane.upwards} [scene units]")
        axes.set_title(f"{self.field.name.capitalize()}, t = {time:.{self._digits}f}", loc="left")
        bands = axes.tricontourf(
            plane.triangulation, values, levels=self.levels, cmap=self.field.colours,
            norm=self.norm, extend="both", zorder=1,
        )  # fmt: skip
        plane.draw_solids(axes, [bands])
        if self.field is SPEED:
            x, y, velocity = plane.velocities(plane.sheet.bounds[:4], _ARROWS)
            axes.quiver(
                x, y, *velocity, color="white", alpha=0.85, zorder=2, width=0.0022, pivot="mid",
                scale=0.8 * _ARROWS * self.levels[-1],
            )  # fmt: skip
        if self.history is not None:
            place = self.history.at(time)
            if not run.in_space:  # how the grain is turned
                _, spoke = seen_from_the_side(run.scene.grain, place)
                axes.plot(*spoke.T, color=INK, lw=1.0, marker="o", markevery=[0], ms=2.5, zorder=4)
            before = self.history.centres[self.history.times < time]
            points = np.vstack([before, (place.centre[0], place.centre[-1])])
            for colour, width in (("white", 2.4), (INK, 1.0)):  # seen on any colour
                axes.plot(*points.T, color=colour, lw=width, zorder=3.5)
        if self.contacts is not None:
            self.contacts.draw(axes, time, self.size)
        axes.set(xlim=self.view[:2], ylim=self.view[2:])
        return []
