"""Contacts of a moving grain with its bed: their forces in their friction cones, at the end of a step."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ..arrays import spatial
from ..errors import OutputError
from ..input_files import reading
from ..output.ownership import CONTACTS
from ..scene import Contact
from .drawing import PLANE, arrow, draw_cone
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
    """Contacts from contacts.csv, in coordinates along the flow and upwards.

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

        Returns the artists: none where the next contacts are not `within` a time.
        """
        drawn: list[Artist] = []
        apart = np.abs(self.times - time)
        nearest = float(apart.min())
        if nearest > within + SAME_TIME * max(abs(time), 1.0):
            return drawn
        for k in np.flatnonzero(self.times == self.times[np.argmin(apart)]):
            slides = int(self.slips[k] > SLIDES * float(self.slips.max()))
            force, colour = self.forces[k], MARKS[slides]
            length = min(USUAL * float(np.linalg.norm(force)) / self.usual, LONGEST) * size
            point, normal = spatial(self.points[k]), spatial(self.normals[k])
            reach, opening = max(SHORTEST * size, 1.15 * length), np.arctan(self.friction[slides])
            drawn.append(draw_cone(axes, PLANE, point, normal, opening, reach, colour))
            if length > 0.0:
                tip = self.points[k] + length * force / np.linalg.norm(force)
                drawn.append(arrow(axes, self.points[k], tip, colour, 1.8))
        return drawn


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
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
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
