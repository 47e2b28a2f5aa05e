"""Path and contacts of a moving grain, from history.csv and contacts.csv."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from ..arrays import spatial
from ..errors import OutputError
from ..geometry.placement import Placement
from ..output.ownership import CONTACTS
from ..scene import Contact
from .drawing import PLANE, draw_contact
from .record import REMEDY, table
from .style import STATES

# Columns of position and orientation, in 2-D and in 3-D.
PLACE = {2: ("x", "y", "angle"), 3: ("x", "y", "z", *(f"quaternion_{part}" for part in "wxyz"))}
_USUAL, _LONGEST = 0.45, 0.9  # arrows of the median force, and at most, in grain sizes
_SAME_TIME = 1e-9  # relative
_SLIDES = 1e-6  # of the fastest slip in a run


@dataclass(frozen=True)
class History:
    """Columns (n,) by name over time; NaN where unknown. Angles in radians, unbounded."""

    columns: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    @property
    def times(self) -> np.ndarray:
        return self.columns["time"]

    @property
    def gdim(self) -> int:
        return _gdim(self.columns)

    @cached_property
    def centres(self) -> np.ndarray:
        return np.column_stack([self.columns["x"], self.columns["xyz"[self.gdim - 1]]])

    @property
    def remeshings(self) -> np.ndarray:
        meshes = self.columns.get("meshes", np.ones(len(self.times)))
        return np.asarray(self.times[np.diff(meshes, prepend=meshes[:1]) > 0])

    def at(self, time: float) -> Placement:
        place = [
            float(np.interp(time, self.times, self.columns[name])) for name in PLACE[self.gdim]
        ]
        if self.gdim == 2:
            return Placement((place[0], place[1]), place[2])
        w, x, y, z = np.divide(place[3:], np.linalg.norm(place[3:])).tolist()
        return Placement(tuple(place[:3]), quaternion=(w, x, y, z))

    def started(self, placement: Placement) -> History:
        """The path preceded by the placement at time zero, unless the first step has it."""
        if self.times[0] <= 0.0:
            return self
        turned = placement.quaternion or (placement.angle,)
        start = dict(zip(PLACE[self.gdim], (*placement.centre, *turned), strict=True))
        start |= {"time": 0.0, "meshes": 1.0}
        return History(
            {
                name: np.insert(rows, 0, start.get(name, np.nan))
                for name, rows in self.columns.items()
            }
        )


def read_history(path: Path) -> History:
    """Read the history of a moving grain; raises OutputError for a missing or damaged file."""
    columns = table(path, REMEDY, "mode")
    names = ("time", *PLACE[_gdim(columns)])
    for name in names:
        if name not in columns:
            raise OutputError(f"{path}: holds no {name}; run the scene again")
    known = np.isfinite([columns[name] for name in names]).all(axis=0)
    if not known.any():
        raise OutputError(f"{path}: holds no place of the grain; run the scene again")
    return History({name: column[known] for name, column in columns.items()})


def _gdim(names: Container[str]) -> int:
    return 3 if "z" in names else 2


@dataclass(frozen=True)
class ContactForces:
    """Contacts at the ends of steps (n,), along the flow and upwards (n, 2); normals from the bed.

    friction: static and kinetic coefficients
    """

    times: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    forces: np.ndarray
    slips: np.ndarray
    friction: tuple[float, float]

    def draw(self, axes: Axes, time: float, size: float, within: float = 0.0) -> list[Artist]:
        """Draw the contacts at the nearest time, if `within` a time: cones, and forces to one scale."""
        drawn: list[Artist] = []
        apart = np.abs(self.times - time)
        if apart.min() > within + _SAME_TIME * max(abs(time), 1.0):
            return drawn
        sizes = np.linalg.norm(self.forces, axis=1)
        usual = float(np.median(sizes[sizes > 0.0])) if sizes.any() else 1.0
        shown = np.minimum(_USUAL / usual, _LONGEST / np.maximum(sizes, 1e-300)) * size
        for k in np.flatnonzero(self.times == self.times[np.argmin(apart)]):
            slides = int(self.slips[k] > _SLIDES * self.slips.max())
            point, normal, force = map(spatial, (self.points[k], self.normals[k], self.forces[k]))
            colour, friction = STATES["SLIDE" if slides else "ROLL"][0], self.friction[slides]
            drawn += draw_contact(
                axes, PLANE, point, normal, shown[k] * force, friction, size, colour
            )
        return drawn


def contact_forces(directory: Path, contact: Contact | None) -> ContactForces | None:
    """Read contacts.csv of a run with a section [contact]; None without contacts. Raises OutputError."""
    path = directory / CONTACTS
    if contact is None or not path.exists():
        return None
    columns = table(path, "run the scene again")
    if not len(columns["time"]):
        return None
    points, normals, forces = (
        np.column_stack(
            [columns[f"{name}{axis}"] for axis in ("x", "z" if "z" in columns else "y")]
        )
        for name in ("", "normal_", "force_")
    )
    kinetic = contact.friction if contact.kinetic_friction is None else contact.kinetic_friction
    friction = contact.friction, kinetic
    return ContactForces(columns["time"], points, normals, forces, columns["slip"], friction)
