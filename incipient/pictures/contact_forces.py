"""Contacts of a moving grain with its bed: their forces in their friction cones, at the end of a step."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Wedge
from matplotlib.patheffects import Normal, Stroke

from ..errors import OutputError
from ..input_files import reading
from ..output.ownership import CONTACTS
from ..scene import Contact
from .style import STATES

MARKS = (
    STATES["ROLL"][0],
    STATES["SLIDE"][0],
)  # colours of contacts that keep their place, and that slide
SAME_TIME = 1e-9  # relative
USUAL, LONGEST, SHORTEST = (
    0.45,
    0.9,
    0.2,
)  # lengths of arrows [grain sizes]: of the median force, and at most; of cones
SLIDES = 1e-6  # of the fastest slip in a run


@dataclass(frozen=True)
class ContactForces:
    """Contacts as they are drawn, along the flow and upwards, from contacts.csv.

    times: (n,) of the ends of their steps; points, normals, forces: (n, 2), normals from the bed; slips: (n,)
    friction: coefficients of contacts that stick, and that slide
    """

    times: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    forces: np.ndarray
    slips: np.ndarray
    friction: tuple[float, float]

    @cached_property
    def usual(self) -> float:
        """The median size of the forces."""
        sizes = np.linalg.norm(self.forces, axis=1)
        return float(np.median(sizes[sizes > 0.0])) if (sizes > 0.0).any() else 1.0

    def draw(self, axes: Axes, time: float, size: float, within: float = 0.0) -> list[Artist]:
        """Draw the contacts of a grain of a size at a time, or next to it: cones, and forces to one scale.

        Returns what was drawn: nothing where the next contacts are not `within` a time.
        """
        drawn: list[Artist] = []
        apart = np.abs(self.times - time)
        nearest = float(apart.min())
        if nearest > within + SAME_TIME * max(abs(time), 1.0):
            return drawn
        for k in np.flatnonzero(self.times == self.times[np.argmin(apart)]):
            slides = self.slips[k] > SLIDES * float(self.slips.max())
            colour = MARKS[int(slides)]
            opening = np.degrees(np.arctan(self.friction[int(slides)]))
            force, point = self.forces[k], self.points[k]
            length = min(USUAL * float(np.linalg.norm(force)) / self.usual, LONGEST) * size
            middle = np.degrees(np.arctan2(*self.normals[k][::-1]))
            reach = max(SHORTEST * size, 1.15 * length)
            cone = Wedge(tuple(point), reach, middle - opening, middle + opening)
            cone.set(facecolor=colour, edgecolor=colour, alpha=0.35, lw=0.8, zorder=5)
            drawn.append(axes.add_artist(cone))
            if length > 0.0:
                drawn.append(
                    axes.add_artist(
                        _arrow(point, point + length * force / np.linalg.norm(force), colour)
                    )
                )
        return drawn


def _arrow(tail: np.ndarray, tip: np.ndarray, colour: str) -> FancyArrowPatch:
    return FancyArrowPatch(
        tuple(tail), tuple(tip), arrowstyle="-|>", mutation_scale=9.0, color=colour, lw=1.8, shrinkA=0, shrinkB=0,
        zorder=6, path_effects=[Stroke(linewidth=3.0, foreground="white", alpha=0.8), Normal()],
    )  # fmt: skip


def contact_forces(directory: Path, contact: Contact | None) -> ContactForces | None:
    """Read contacts.csv of a run with a section [contact]; None where it had no contacts.

    Raises:
        OutputError: it is damaged.
    """
    path = directory / CONTACTS
    if contact is None or not path.exists():
        return None
    kinetic = contact.friction if contact.kinetic_friction is None else contact.kinetic_friction
    with reading(path, "run the scene again", error=OutputError):
        with path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        upwards = "z" if rows and "z" in rows[0] else "y"
        pairs = {
            name: np.array(
                [[float(row[f"{name}x"]), float(row[f"{name}{upwards}"])] for row in rows]
            )
            for name in ("", "normal_", "force_")
        }
        times, slips = (np.array([float(row[name]) for row in rows]) for name in ("time", "slip"))
    if not rows:
        return None
    points, normals, forces = pairs.values()
    return ContactForces(times, points, normals, forces, slips, (contact.friction, kinetic))
