"""The contact surface Gamma_c of a grain, the closest points of grain and bed, and the forces of contacts.

Motions and loads are rows: translation (force), then rotation (torque) about the centre, with `size` as unit of
length; in 2-D 3 components, in 3-D 6.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Booleans, Floats, cross, planar_cross, quarter_turned, unit
from incipient.errors import refuse_broken

UNIT_TOLERANCE = 1e-6  # how far the length of a unit normal or quaternion may be from one
SAME_NORMAL = 1e-4  # components of normals that differ by less belong to one place
BALANCED = 1e-12  # of the load: what remains of it that is nothing, and what a generator gains that is none


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contact surface Gamma_c as points (n, 3) with unit normals (n, 3) that point OUT of the grain.

    `areas` (n,) are zero at point contacts; None without a patch. A patch is given by its corners, each with its part
    of the area. In 2-D third components are zero. Raises SceneError on invalid numbers or without any contact.
    """

    points: Floats
    normals: Floats
    areas: Floats | None = None

    def __post_init__(self) -> None:
        points, normals = np.array(self.points, float), np.array(self.normals, float)
        alone = "contacts: there is none; a grain that touches nothing cannot be judged, rest it"
        refuse_broken((len(points) == 0, alone))
        for name, table in (("points", points), ("normals", normals)):
            refuse_broken(
                (
                    table.ndim != 2 or table.shape[1] != 3,
                    f"contacts: {name} have shape {table.shape}; give (n, 3), in 2-D with zeros",
                ),
                (
                    not np.isfinite(table).all(),
                    f"contacts: {name} contain a number that is not finite; give finite numbers",
                ),
            )
        counts = f"{len(points)} points but {len(normals)} normals"
        refuse_broken((len(points) != len(normals), f"contacts: {counts}; give one normal a point"))
        lengths = np.linalg.norm(normals, axis=1)
        k = int(np.argmax(np.abs(lengths - 1.0)))
        uneven = f"contacts: normal {k} has length {lengths[k]:g}; give unit normals"
        refuse_broken((abs(lengths[k] - 1.0) > UNIT_TOLERANCE, uneven))
        freeze(self, "points", points)
        freeze(self, "normals", normals / lengths[:, None])
        if self.areas is not None:
            areas = np.array(self.areas, float)
            refuse_broken(
                (
                    areas.shape != (len(points),),
                    f"contacts: areas have shape {areas.shape}; give one for each of {len(points)} points",
                ),
                (
                    not (np.isfinite(areas).all() and (areas >= 0.0).all()),
                    "contacts: areas must be finite and not negative; give 0 for point contacts",
                ),
            )
            freeze(self, "areas", areas)

    def __len__(self) -> int:
        return len(self.points)


def freeze(owner: object, name: str, value: Floats) -> None:
    """Set a field of a frozen dataclass to a read-only array."""
    value.flags.writeable = False
    object.__setattr__(owner, name, value)


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Local minima (k,) of the signed distance between a grain, or points, and a bed.

    `gaps` (k,) are negative inside the bed, `points` (k, d) lie on the grain, `normals` (k, d) are the bed's, into the
    fluid; None: not known.
    """

    gaps: Floats
    points: Floats
    normals: Floats
    hessians: Any = None  # second derivatives of the distance, (k, d, d)
    anchors: Any = None  # of the points, in the body frame: in 3-D on the swept core
    # In 2-D curve of the outline and whether the place is its start (k, 2); in 3-D core (-1: none), triangle (negative:
    # corner or edge) and piece of the bed (k, 3)
    origin: Any = None
    pieces: Any = None  # of the bed, which `origin` counts

    def __len__(self) -> int:
        return len(self.gaps)

    @property
    def feet(self) -> Floats:
        return np.asarray(self.points - self.gaps[:, None] * self.normals)

    def only(self, which: ArrayLike) -> "ClosestPoints":
        index = np.asarray(which)
        index = index if index.dtype == bool else index.astype(int)
        return replace(self, **{name: table[index] for name, table in self._tables().items()})

    def replaced(self, rows: np.ndarray, others: "ClosestPoints") -> "ClosestPoints":
        """Closest points with `rows` (m,) replaced by others (m,)."""
        tables = {name: table.copy() for name, table in self._tables().items()}
        for name, table in tables.items():
            table[rows] = getattr(others, name)
        return replace(self, **tables)

    @staticmethod
    def joined(parts: "Sequence[ClosestPoints]") -> "ClosestPoints":
        tables = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in parts[0]._tables()
        }
        return replace(parts[0], **tables)

    def distinct(self, tolerance: float) -> "ClosestPoints":
        """The lowest, of equal ones the first, of each group that shares a point, within a length, and a normal."""
        same, keep = coincident(self.points, self.normals, tolerance, SAME_NORMAL), list[int]()
        # Round-off must not decide between a corner and the edges that meet there.
        for number in np.argsort(np.round(self.gaps / tolerance, 6), kind="stable").tolist():
            if not same[number, keep].any():
                keep.append(number)
        return self.only(np.sort(keep))

    def _tables(self) -> dict[str, np.ndarray]:
        return {name: table for name, table in vars(self).items() if isinstance(table, np.ndarray)}


def coincident(points: Floats, normals: Floats, place: float, turn: float) -> Booleans:
    """Which of k contacts (k, d) are at one place with one normal (k, k), to tolerances of their components."""
    from scipy.spatial.distance import cdist  # which takes time to import

    same = cdist(points, points, "chebyshev") <= place
    return np.asarray(same & (cdist(normals, normals, "chebyshev") <= turn))


def shares(points: Floats, normals: Floats, areas: Floats | None = None) -> Floats:
    """Fraction (..., k) that each point (..., k, d) is of its contact, by areas (..., k) or equal.

    Points of one plane with one normal are one contact, such as the corners of a patch.
    """
    apart = points[..., :, None, :] - points[..., None, :, :]
    turned = np.abs(normals[..., :, None, :] - normals[..., None, :, :]).max(axis=-1)
    height = np.abs((apart * normals[..., None, :]).sum(axis=-1))
    size = np.abs(apart).max(axis=(-3, -2, -1), keepdims=True)[..., 0]
    same = (turned <= SAME_NORMAL) & (height <= 1e-6 * size)  # in one plane
    weights = np.ones(points.shape[:-1]) if areas is None else np.maximum(areas, 1e-300)
    return np.asarray(weights / (same @ weights[..., None])[..., 0])


def tangents(normals: Floats) -> list[Floats]:
    """One or two unit tangents (..., d), perpendicular to unit normals (..., d) and to each other."""
    if normals.shape[-1] == 2:
        return [-quarter_turned(normals)]
    least = np.eye(3)[np.argmin(np.abs(normals), axis=-1)]
    first = unit(cross(normals, least))
    return [first, cross(normals, first)]


@dataclass(frozen=True, eq=False)
class Hold:
    """Contact forces that balance a load (n,) as far as friction allows.

    `rows` (m, n), each of the contact `owner` (m,), are combined with nonnegative `factors` (m,). `remainder` (n,) is
    the unbalanced part, the direction in which the load moves the grain.
    """

    rows: Floats
    owner: np.ndarray
    factors: Floats
    remainder: Floats


def wrenches(forces: Floats, arms: Floats, size: float) -> Floats:
    """Forces (m, d) at arms (m, d) from the centre with their torques, (m, 3 or 6)."""
    torque = planar_cross(arms, forces)[:, None] if forces.shape[1] == 2 else cross(arms, forces)
    return np.hstack([forces, torque / size])


def hold(load: Floats, normals: Floats, arms: Floats, friction: float, size: float) -> Hold:
    """Balance a load (n,) by forces within the friction cones of contacts (k,); friction may be 0 or infinite.

    Cones in 3-D are exact: the generators that oppose the remainder most are added until none reduces it.
    """
    along = [sense * tangent for tangent in tangents(normals) for sense in (1.0, -1.0)]
    if friction == 0.0:
        forces = [normals]
    elif np.isinf(friction):
        forces = [normals, *along]
    else:
        forces = [normals + friction * side for side in along]
    each = np.arange(len(normals))
    rows = np.vstack([wrenches(force, arms, size) for force in forces])
    owner = np.tile(each, len(forces))
    remainder, factors = balance(rows, load)
    round_cones = len(forces) == 4 and len(normals) > 0
    for _ in range(60 if round_cones else 0):
        velocity = remainder[:3] + cross(remainder[3:], arms) / size
        velocity -= (velocity * normals).sum(axis=1, keepdims=True) * normals
        opposing = wrenches(normals - friction * unit(velocity), arms, size)
        small = np.abs(remainder).max() <= BALANCED * np.abs(load).max()
        if small or (opposing @ remainder).min() >= -BALANCED:
            break
        rows, owner = np.vstack([rows, opposing]), np.append(owner, each)
        remainder, factors = balance(rows, load)
    return Hold(rows, owner, factors, remainder)


def balance(rows: Floats, load: Floats) -> tuple[Floats, Floats]:
    """The smallest unbalanced part (n,) of a load (n,) under forces along rows (m, n), and their factors (m,).

    The unbalanced part enters no contact.
    """
    if len(rows) == 0:
        return load, np.empty(0)
    factors = _least_squares(rows.T, -load)
    return load + factors @ rows, factors


def nearest_motion(rows: Floats, least: Floats, wish: Floats) -> Floats:
    """The motion (n,) closest to a wish (n,) with rows @ motion >= least (m,), least <= 0.

    Least distance programming (Lawson and Hanson 1974, chapter 23).
    """
    if len(rows) == 0:
        return wish
    levels = least - rows @ wish
    system = np.vstack([rows.T, levels])
    target = np.zeros(len(system))
    target[-1] = 1.0
    factors = _least_squares(system, target)
    residual = system @ factors - target
    return np.asarray(wish - residual[:-1] / min(residual[-1], -1e-300))


def _least_squares(system: Floats, target: Floats) -> Floats:
    from scipy.optimize import nnls

    factors, _ = nnls(system, target, maxiter=50 * max(system.shape))
    return np.asarray(factors)
