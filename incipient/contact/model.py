"""What a judge of incipient motion is given: where the grain is touched, and what acts on it.

Everything is three-dimensional; a plane case has third components of zero and couples along the third axis.
Units are the caller's, as long as they are consistent.
"""

from dataclasses import dataclass, fields

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
            raise SceneError(f"contacts: normal {worst} has length {lengths[worst]:g}; give unit normals")
        _freeze(self, "points", points)
        _freeze(self, "normals", normals / lengths[:, None])
        if self.areas is not None:
            _freeze(self, "areas", _areas(self.areas, len(points)))

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Load:
    """What acts on the grain besides the bed, each (3,).

    `flow_force`: the flow's force on the grain; `flow_couple`: its couple about `centre`; `weight`: all else
    that acts at `centre`, the centre of mass, such as weight and buoyancy. Raises SceneError on anything but
    three finite numbers each.
    """

    flow_force: Floats
    flow_couple: Floats
    weight: Floats
    centre: Floats

    def __post_init__(self) -> None:
        for item in fields(self):
            value = np.array(getattr(self, item.name), dtype=float)
            if value.shape != (3,):
                raise SceneError(f"load: {item.name} has shape {value.shape}; give three components")
            if not np.isfinite(value).all():
                raise SceneError(f"load: {item.name} is {value.tolist()}; give finite numbers")
            _freeze(self, item.name, value)

    @property
    def force(self) -> Floats:
        """F_flow&g of (9): flow force and weight together, (3,)."""
        return self.flow_force + self.weight

    @property
    def couple(self) -> Floats:
        """tau_flow&g of (21) about the centre of mass, where the weight has no couple, (3,)."""
        return self.flow_couple


def require_outward(contacts: Contacts, centre: Floats) -> None:
    """Refuse contacts whose normals all point into the grain, toward its centre of mass: a sign mistaken.

    One of several may do so on a grain that is not convex. Raises SceneError.
    """
    if (((contacts.points - centre) * contacts.normals).sum(axis=1) < 0.0).all():
        raise SceneError("contacts: all normals point into the grain; give them pointing out, into the bed")


def _table(name: str, value: Floats) -> Floats:
    table = np.array(value, dtype=float)
    if table.size == 0:
        return np.empty((0, 3))
    if table.ndim != 2 or table.shape[1] != 3:
        raise SceneError(f"contacts: {name} have shape {table.shape}; give (n, 3), in the plane with zeros")
    if not np.isfinite(table).all():
        raise SceneError(f"contacts: {name} contain a number that is not finite; give finite numbers")
    return table


def _areas(value: Floats, count: int) -> Floats:
    areas = np.array(value, dtype=float)
    if areas.shape != (count,):
        raise SceneError(f"contacts: areas have shape {areas.shape}; give one for each of {count} points")
    if not (np.isfinite(areas).all() and (areas >= 0.0).all()):
        raise SceneError("contacts: areas must be finite and not negative; give 0 for point contacts")
    return areas


def _freeze(owner: object, name: str, value: Floats) -> None:
    value.flags.writeable = False
    object.__setattr__(owner, name, value)
