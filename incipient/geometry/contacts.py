"""The contact surface Gamma_c of a grain: where the bed touches it, and in which directions.

Everything is three-dimensional; contacts in the plane have third components of zero.
"""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError

UNIT_TOLERANCE = 1e-6  # how far the length of a unit normal may be from one


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contact surface Gamma_c as points (n, 3) with unit normals (n, 3) that point OUT of the grain.

    `areas` (n,) are zero at point contacts; None: point contacts only. A patch is given by its corners, each
    with its part of the area. Raises SceneError on wrong shapes, numbers that are not finite, normals that
    are not unit vectors, negative areas, and if there is no contact at all.
    """

    points: Floats
    normals: Floats
    areas: Floats | None = None

    def __post_init__(self) -> None:
        points, normals = _table("points", self.points), _table("normals", self.normals)
        if len(points) == 0:
            raise SceneError(
                "contacts: there is none; a grain that touches nothing cannot be judged, rest it"
            )
        if len(points) != len(normals):
            raise SceneError(
                f"contacts: {len(points)} points but {len(normals)} normals; give one normal a point"
            )
        lengths = np.linalg.norm(normals, axis=1)
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        if abs(lengths[worst] - 1.0) > UNIT_TOLERANCE:
            raise SceneError(
                f"contacts: normal {worst} has length {lengths[worst]:g}; give unit normals"
            )
        freeze(self, "points", points)
        freeze(self, "normals", normals / lengths[:, None])
        if self.areas is not None:
            freeze(self, "areas", _areas(self.areas, len(points)))

    def __len__(self) -> int:
        return len(self.points)


def _table(name: str, value: Floats) -> Floats:
    table = np.array(value, dtype=float)
    if table.size == 0:
        return np.empty((0, 3))
    if table.ndim != 2 or table.shape[1] != 3:
        raise SceneError(
            f"contacts: {name} have shape {table.shape}; give (n, 3), in the plane with zeros"
        )
    if not np.isfinite(table).all():
        raise SceneError(
            f"contacts: {name} contain a number that is not finite; give finite numbers"
        )
    return table


def _areas(value: Floats, count: int) -> Floats:
    areas = np.array(value, dtype=float)
    if areas.shape != (count,):
        raise SceneError(
            f"contacts: areas have shape {areas.shape}; give one for each of {count} points"
        )
    if not (np.isfinite(areas).all() and (areas >= 0.0).all()):
        raise SceneError(
            "contacts: areas must be finite and not negative; give 0 for point contacts"
        )
    return areas


def freeze(owner: object, name: str, value: Floats) -> None:
    """Set a field of a frozen dataclass to an array that nobody can change any more."""
    value.flags.writeable = False
    object.__setattr__(owner, name, value)
