"""Picture of a moving grain, from history.csv and contacts.csv: its path, in 3-D from the side, and six quantities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from ..arrays import spatial
from ..errors import OutputError
from ..geometry.placement import Placement
from ..output.ownership import CONTACTS
from ..scene import Contact, Domain, Scene
from . import style
from .drawing import PLANE, draw_bed, draw_contact
from .plane import bed_line, seen_from_the_side
from .record import REMEDY, StoredRun, table
from .style import GRAIN, INK, STATES

# Early to late; the palest part of the map would be lost on white.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)), "moments")
_SHOWN = {
    2: ("x", "y", "angle", "velocity_x", "velocity_y", "spin"),
    3: ("x", "y", "z", "spin_x", "spin_y", "spin_z"),
}


# Columns of position and orientation, in 2-D and in 3-D.
PLACE = {2: ("x", "y", "angle"), 3: ("x", "y", "z", *(f"quaternion_{part}" for part in "wxyz"))}


@dataclass(frozen=True)
class History:
    """Columns (n,) by name over time; NaN where unknown. Angles in radians, unbounded."""

    columns: dict[str, np.ndarray]

    @property
    def times(self) -> np.ndarray:
        return self.columns["time"]

    @property
    def gdim(self) -> int:
        return 3 if "z" in self.columns else 2

    @cached_property
    def centres(self) -> np.ndarray:
        return np.column_stack([self.columns["x"], self.columns["xyz"[self.gdim - 1]]])

    def at(self, time: float) -> Placement:
        place = [
            float(np.interp(time, self.times, self.columns[name])) for name in PLACE[self.gdim]
        ]
        if self.gdim == 2:
            return Placement((place[0], place[1]), place[2])
        w, x, y, z = np.divide(place[3:], np.linalg.norm(place[3:])).tolist()
        return Placement(tuple(place[:3]), quaternion=(w, x, y, z))


def read_history(path: Path) -> History:
    """Read the history of a moving grain; raises OutputError for a missing or damaged file."""
    stored = History(table(path, REMEDY, "mode"))
    names = ("time", *PLACE[stored.gdim])
    for name in names:
        if name not in stored.columns:
            raise OutputError(f"{path}: holds no {name}; run the scene again")
    known = np.isfinite([stored.columns[name] for name in names]).all(axis=0)
    if not known.any():
        raise OutputError(f"{path}: holds no place of the grain; run the scene again")
    return History({name: column[known] for name, column in stored.columns.items()})


@dataclass(frozen=True)
class ContactForces:
    """Contacts at the ends of steps by column (n,); static and kinetic coefficients of friction."""

    columns: dict[str, np.ndarray]
    friction: tuple[float, float]

    def draw(self, axes: Axes, time: float, size: float, within: float = 0.0) -> list[Artist]:
        """Draw the contacts at the nearest time, if `within` a time: cones, and forces to one scale."""
        drawn: list[Artist] = []
        times, slips = self.columns["time"], self.columns["slip"]
        apart = np.abs(times - time)
        if apart.min() > within + 1e-9 * max(abs(time), 1.0):  # round-off
            return drawn
        plane = ("x", "z" if "z" in self.columns else "y")
        points, normals, forces = (
            spatial(np.column_stack([self.columns[f"{name}{axis}"] for axis in plane]))
            for name in ("", "normal_", "force_")
        )
        sizes = np.linalg.norm(forces, axis=1)
        usual = float(np.median(sizes[sizes > 0.0])) if sizes.any() else 1.0
        # The median force is 0.45 grain sizes long, none longer than 0.9.
        arms = np.minimum(0.45 / usual, 0.9 / np.maximum(sizes, 1e-300))[:, None] * forces
        for k in np.flatnonzero(times == times[np.argmin(apart)]):
            slides = int(slips[k] > 1e-6 * slips.max())  # of the fastest slip in the run
            colour, friction = STATES["SLIDE" if slides else "ROLL"][0], self.friction[slides]
            drawn += draw_contact(
                axes, PLANE, points[k], normals[k], size * arms[k], friction, size, colour
            )
        return drawn


def contact_forces(directory: Path, contact: Contact | None) -> ContactForces | None:
    """Read contacts.csv of a run with a section [contact]; None without contacts. Raises OutputError."""
    path = directory / CONTACTS
    if contact is None or not path.exists():
        return None
    columns = table(path, "run the scene again")
    kinetic = contact.friction if contact.kinetic_friction is None else contact.kinetic_friction
    return ContactForces(columns, (contact.friction, kinetic)) if len(columns["time"]) else None


# -- the picture -------------------------------------------------------------------------------------


def picture(run: StoredRun) -> Figure:
    """Path of the grain of a run; raises OutputError for a missing or damaged history."""
    history = read_history(run.directory / "history.csv")
    contacts = contact_forces(run.directory, run.scene.contact)
    return figure(run.scene, history, run.headline, contacts)


def figure(
    scene: Scene, history: History, title: str, contacts: ContactForces | None = None
) -> Figure:
    """Path of the grain with contact forces, beside six quantities against time."""
    grain, start, bed = scene.grain, scene.placement, scene.bed_shape
    assert grain is not None and start is not None
    sheet = Figure(figsize=(10.8, 5.8), layout="constrained")
    style.headline(sheet, title)
    rows = [["map", *"03"], ["map", *"14"], ["map", *"25"]]
    panels: dict[str, Axes] = sheet.subplot_mosaic(rows, width_ratios=(2, 1.4, 1.4))
    axes, norm = panels["map"], Normalize(*history.times[[0, -1]])
    _draw_path(axes, grain, history, norm)
    x0, y0 = history.centres.min(axis=0) - 0.7 * grain.size
    x1, y1 = history.centres.max(axis=0) + 0.7 * grain.size
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", title="Path of the grain")
    axes.set(xlabel="x [scene units]", ylabel=f"{'xyz'[scene.up]} [scene units]")
    if scene.bed is not None:
        draw_bed(axes, _ground(scene.domain, bed, start))
    if contacts is not None:
        _draw_contacts(axes, contacts, grain.size, history)
    sheet.colorbar(
        ScalarMappable(norm, _COLOURS), ax=axes, label="time along the path [scene units]"
    )
    for place, name in enumerate(_SHOWN[history.gdim]):
        _draw_quantity(panels[f"{place}"], name, history, grain.size, scene.reference_velocity)
    for key in "25":
        panels[key].set_xlabel("time [scene units]", fontsize=8)
    style.explain(sheet, loc="outside lower left", ncols=6)
    return sheet


def _ground(domain: Domain, bed: Any, start: Placement) -> np.ndarray:
    """Points (n, 2) along the bed from left to right, in 3-D below the grain's start."""
    if domain.gdim == 2:
        return bed_line(bed, domain.left, domain.right)
    x = np.linspace(domain.left, domain.right, 800)
    return np.column_stack([x, bed.height(np.column_stack([x, np.full_like(x, start.centre[1])]))])


def _draw_path(axes: Axes, grain: Any, history: History, norm: Normalize) -> None:
    first, *between, last = _moments(grain.size, history)
    for time in between:
        _draw_grain(axes, grain, history.at(time), 4.0, ec=_COLOURS(norm(time)), lw=0.8, fc="none")
    place, label = history.at(last), f"grain at t = {last:.4g}"
    _draw_grain(axes, grain, place, 4.5, ec=INK, lw=1.7, fc=GRAIN, label=label)
    # Above the end and dashed: both may be in one place.
    place, label = history.at(first), f"grain at t = {first:.4g}"
    _draw_grain(axes, grain, place, 5.0, ec=INK, lw=1.3, fc="none", ls=(0, (3, 1.5)), label=label)
    axes.lines[-1].set_label("first body axis")
    points, times = history.centres, history.times
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(
        pieces, array=(times[:-1] + times[1:]) / 2, cmap=_COLOURS, norm=norm, lw=1.6, zorder=6
    )
    axes.add_collection(path, autolim=False)


def _draw_contacts(axes: Axes, contacts: ContactForces, size: float, history: History) -> None:
    step, drawn = float(np.diff(history.times).max(initial=0.0)), []
    for time in _moments(size, history):
        drawn += contacts.draw(axes, time, size, step if time < history.times[-1] else 0.0)
    if drawn:
        drawn[0].set_label("contact force in its cone")


def _moments(size: float, history: History) -> list[float]:
    """Times of equal ways of the centre between them, at most 20 of at least 0.45 grain sizes."""
    steps = np.diff(history.centres, axis=0, prepend=history.centres[:1])
    way = np.cumsum(np.linalg.norm(steps, axis=1))
    number = int(np.clip(way[-1] / (0.45 * size), 1, 20))
    between = np.interp(np.linspace(0.0, way[-1], number + 1), way, history.times)
    return [float(history.times[0]), *between[1:-1].tolist(), float(history.times[-1])]


def _draw_grain(axes: Axes, grain: Any, placement: Placement, order: float, **looks: Any) -> None:
    outline, spoke = seen_from_the_side(grain, placement)
    axes.add_artist(Polygon(outline, zorder=order, joinstyle="round", **looks))
    axes.add_artist(Line2D(
        *spoke.T, marker="o", markevery=[0], zorder=order, color=looks["ec"], lw=0.75 * looks["lw"],
        ms=1.9 * looks["lw"],
    ))  # fmt: skip


def _draw_quantity(axes: Axes, name: str, history: History, size: float, velocity: float) -> None:
    values = history.columns[name]
    # Unit, and the smallest range of the axis: round-off is not blown up.
    unit, least = {
        "angle": ("degrees", 1.0),
        "velocity": ("scene units", 1e-4 * velocity),
        "spin": ("rad per unit of time", 1e-4 * velocity / size),
    }.get(name.partition("_")[0], ("scene units", 1e-3 * size))
    if name == "angle":
        values = np.degrees(values)
    axes.plot(history.times, values, color=style.FLOW, lw=1.2)
    axes.set_title(f"{name.replace('_', ' ')} [{unit}]", fontsize=8)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    middle, half = (low + high) / 2, 0.55 * max(high - low, least)
    axes.set(xlim=history.times[[0, -1]], ylim=(middle - half, middle + half))
    axes.grid(color="#e2e2e2", lw=0.5)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter("{x:.6g}")
