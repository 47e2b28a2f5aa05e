"""A run in motion: one field of the flow at the steps that were stored, in the plane and in space.

Fields are shown in bands of colour, the same in all frames: bands compress many times better than shades.
"""

from __future__ import annotations

import math
import textwrap
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
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
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator
from scipy.spatial import KDTree

from ...errors import OutputError
from ...geometry.placement import Placement
from ...output.series_file import read_step, times
from ...scene import Scene
from .. import style
from ..flow.mesh import curve, triangles_of
from ..flow.section import VerticalSection, draw_outlines, section_of, views_of
from ..record import StoredRun, parsed_json, read_scene
from ..style import GRAIN, GROUND, INK, View
from . import film_file
from .contact_forces import MARKS, ContactForces, contact_forces
from .film_file import DOTS, Frames
from .history import History, read_history
from .trajectory import spoke

_MOST_FRAMES = 200
_SECONDS, _RATES = 8.0, (4, 20)  # about how long it takes, and frames per second
ARROWS, _SLOWEST = 24, 0.01  # along the longer side; of the fastest: where there is none
_SAMPLES = 2000  # nodes of each frame that colours are chosen by
_BANDS = 24
_POINTS = 320  # of the grid in space, along its longer side
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

    marks = MARKS

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
        self.axes.set_title(
            f"{self.field.name.capitalize()}, t = {time:.{self._digits}f}", loc="left"
        )
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

    @cached_property
    def contacts(self) -> ContactForces | None:
        """The contacts of a grain that moves on its bed."""
        return contact_forces(self.directory, Scene(**self.scene).contact)

    def touching(self, time: float) -> list[Artist]:
        """Forces of contact at a time, in their friction cones."""
        if self.contacts is None:
            return []
        return self.contacts.draw(self.axes, time, Scene(**self.scene).grain.size)

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
        bar = figure.add_axes(
            ((_LEFT + across + 0.1) / width, _BOTTOM / height, 0.13 / width, up / height)
        )
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
        looks = (("white", 2.4), (INK, 1.0))
        lines = [Line2D(*points.T, color=colour, lw=width, zorder=3.5) for colour, width in looks]
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


class FilmInPlane(Film):
    """One field on all cells, the grain with a spoke that shows how it is turned, its way so far."""

    _upwards = "y"

    def _box(self) -> View:
        first = self.run(0)
        if first.setting("domain", "top") != "free-surface":
            return first.box
        # A surface rises above where it began.
        return (*first.box[:3], max(self.run(number).box[3] for number in range(self.count)))

    def _shown(self, run: StoredRun, time: float) -> list[Artist]:
        drawn = [self._painted(run), *self._solids(run), *self.way(time), *self._spoke(run, time)]
        drawn += self.touching(time)
        if self.field.name == "speed":
            drawn.append(self._flow(run))
        return drawn

    def _painted(self, run: StoredRun) -> Artist:
        triangles = triangles_of(run.mesh.points, run.mesh.quarters)
        return self.axes.tricontourf(
            triangles, self.field.values(run), levels=self.levels, cmap=self.colours, norm=self.norm,
            extend=self.field.beyond, zorder=1,
        )  # fmt: skip

    def _solids(self, run: StoredRun) -> list[Artist]:
        """The boundary of the fluid and the grains in it."""
        outer, *holes = (curve(run.mesh.points, loop) for loop in run.mesh.loops)
        drawn = [Polygon(outer, fill=False, edgecolor=INK, lw=0.8, zorder=3)]
        drawn += [Polygon(hole, facecolor=GRAIN, edgecolor=INK, lw=1.0, zorder=3) for hole in holes]
        return [self.axes.add_artist(patch) for patch in drawn]

    def _spoke(self, run: StoredRun, time: float) -> list[Artist]:
        if self.history is None or len(run.mesh.loops) < 2:
            return []
        axis = spoke(curve(run.mesh.points, run.mesh.loops[1]), self.history.at(time))
        line = Line2D(*axis.T, color=INK, lw=1.0, marker="o", markevery=[0], ms=2.5, zorder=4)
        return [self.axes.add_artist(line)]

    def _flow(self, run: StoredRun) -> Artist:
        """The velocity on a regular grid, from the three nearest nodes."""
        x0, x1, y0, y1 = run.box
        spacing = max(x1 - x0, y1 - y0) / ARROWS
        grid = np.meshgrid(
            np.arange(x0 + spacing / 2, x1, spacing), np.arange(y0 + spacing / 2, y1, spacing)
        )
        places = np.column_stack([one.ravel() for one in grid])
        places = places[_in_fluid(run, places)]
        distances, nodes = KDTree(run.mesh.points).query(places, k=3)
        weights = 1.0 / np.maximum(distances, 1e-9 * spacing)
        weights /= weights.sum(axis=1, keepdims=True)
        velocities = np.einsum("nk,nkd->nd", weights, run.field("velocity")[nodes, :2])
        return self.arrows(places, velocities, spacing)


def _in_fluid(run: StoredRun, places: np.ndarray) -> np.ndarray:
    """(n,) whether places lie inside the outer boundary and outside the grains."""
    outer, *holes = (Outline(curve(run.mesh.points, loop, 2)) for loop in run.mesh.loops)
    inside = outer.contains_points(places)
    for hole in holes:
        inside &= ~hole.contains_points(places)
    return inside


class FilmInSpace(Film):
    """One field in the plane, the grain's silhouette, its way so far."""

    _upwards = "z"

    def _box(self) -> View:
        return views_of(self.run(0))[0]

    def run(self, number: int) -> StoredRun:
        """The step that a frame shows, with the grain where it is then."""
        run = self.stored(number)
        placement = self._placement(float(self.moments[number])) if run.scene.get("body") else None
        if placement is None:
            return run
        grain = {"computed_centre": placement.centre, "quaternion": placement.quaternion}
        return replace(run, result={"grain": grain | {"size": Scene(**run.scene).grain.size}})

    def _placement(self, time: float) -> Placement | None:
        """Where the grain is: by its history, else where the mesh was made for it, else where the scene puts it."""
        if self.history is not None:
            return self.history.at(time)
        try:
            grain = parsed_json(self.directory / "result.json")["grain"]
            return Placement(tuple(grain["computed_centre"]), quaternion=tuple(grain["quaternion"]))
        except (OutputError, KeyError, TypeError):  # the run goes on
            return Scene(**self.scene).placement

    def _shown(self, run: StoredRun, time: float) -> list[Artist]:
        names = {"velocity", "velocity" if self.field.name == "speed" else self.field.name}
        section = section_of(run, self.view, sorted(names), _POINTS)
        image = self._painted(section)
        drawn = [image, *draw_outlines(self.axes, section, image), *self.way(time)]
        drawn += self.touching(time)
        if self.field.name == "speed":
            drawn.append(self._flow(section))
        return drawn

    def _painted(self, section: VerticalSection) -> AxesImage:
        values = self.field.of(section.fields)
        return self.axes.imshow(
            values, origin="lower", extent=section.view, cmap=self.colours,
            norm=self.norm, interpolation="bilinear", aspect="auto", zorder=1,
        )  # fmt: skip

    def _flow(self, section: VerticalSection) -> Artist:
        """The velocity within the plane on every so many points of the grid."""
        apart = max(1, max(section.inside.shape) // ARROWS)
        chosen = (slice(apart // 2, None, apart),) * 2
        rows, columns = np.nonzero(section.inside[chosen])
        places = np.column_stack([section.x[chosen[1]][columns], section.z[chosen[0]][rows]])
        velocities = section.fields["velocity"][chosen][rows, columns][:, [0, 2]]
        return self.arrows(places, velocities, apart * section.spacing)


def animate(directory: Path, target: Path | None = None, field: str = "velocity") -> Path:
    """Show a field of a run in motion; returns the file written. Not collective.

    A run in space is shown in the vertical plane through the grain.

    `target` ends in .gif or .mp4; by default it is DIRECTORY/FIELD.gif. Every stored step is a frame, or 200 of
    them, evenly spaced in time. The result need not be there: a run may be watched while it goes on.

    Raises:
        OutputError: with fewer than two steps, without ffmpeg for an MP4, or when it cannot be written.
    """
    path = target or directory / f"{field}.gif"
    film_file.check(path)
    indices, moments = _frames(directory / "fields")
    rate = int(np.clip(len(indices) / _SECONDS, *_RATES))
    first = StoredRun(directory, {}, {}, read_step(directory / "fields", int(indices[0])), None)
    with style.applied():
        film = (FilmInSpace if first.in_space else FilmInPlane)(
            directory, FIELDS[field], indices, moments
        )
        film_file.write(film, path, rate)
    return path


def _frames(stem: Path) -> tuple[np.ndarray, np.ndarray]:
    """Indices and times of the steps to show: those closest to evenly spaced times."""
    stored = np.array(times(stem))
    if len(stored) < 2:
        remedy = "run the scene with [time] and --set output.every=1"
        raise OutputError(f"{stem}.h5: holds a single step; {remedy}")
    wanted = np.linspace(stored[0], stored[-1], min(len(stored), _MOST_FRAMES))
    after = np.clip(np.searchsorted(stored, wanted), 1, len(stored) - 1)
    nearest = np.where(wanted - stored[after - 1] < stored[after] - wanted, after - 1, after)
    if len(stored) <= _MOST_FRAMES:
        nearest = np.arange(len(stored))
    indices = np.unique(nearest)
    return indices, stored[indices]
