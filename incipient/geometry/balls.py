"""Unions of balls: what those of discs in the plane and of spheres in space have in common."""

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry.shape import Shape

OVERLAP = 1e-6  # of the smaller radius: balls that overlap by less do not hang together


class Balls(Shape):
    """Balls that hang together, about the centroid of their union."""

    centres: tuple[tuple[float, ...], ...]
    radii: tuple[float, ...]

    @property
    def size(self) -> float:
        """The largest distance of two centres and their radii, or diameter."""
        centres, radii = np.array(self.centres), np.array(self.radii)
        apart = np.linalg.norm(centres[:, None] - centres, axis=2)
        return float((apart + np.add.outer(radii, radii)).max())

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance from the nearest ball at points (n, gdim): outside the distance from the grain."""
        away = np.linalg.norm(rows(x)[:, None] - np.array(self.centres), axis=2)
        return np.asarray((away - np.array(self.radii)).min(axis=1))

    def normal(self, x: ArrayLike) -> Floats:
        """The normals (n, gdim) of the ball nearest to each of the points (n, gdim), in creases the bisector."""
        away = rows(x)[:, None] - np.array(self.centres)
        length = np.linalg.norm(away, axis=2)
        outward = away / np.maximum(length, 1e-300)[..., None]
        distance = length - np.array(self.radii)
        nearest = distance <= distance.min(axis=1, keepdims=True) + 1e-12 * self.size
        return unit((outward * nearest[..., None]).sum(axis=1))


def checked_balls(centres: ArrayLike, radii: ArrayLike, dimension: int) -> tuple[Floats, Floats]:
    """Centres (n, dimension) and radii (n,) as tables, checked to be discs or spheres that hang together."""
    points, sizes = np.array(centres, dtype=float), np.array(radii, dtype=float)
    if (
        points.ndim != 2
        or points.shape[1] != dimension
        or not len(points)
        or sizes.shape != (len(points),)
    ):
        raise SceneError(
            f"give one centre of {dimension} coordinates and one radius for each ball of a union"
        )
    if not (np.isfinite(points).all() and np.isfinite(sizes).all() and (sizes > 0.0).all()):
        raise SceneError("a union needs finite centres and positive radii; change them")
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    slack = OVERLAP * np.minimum.outer(sizes, sizes)
    linked = apart < np.add.outer(sizes, sizes) - slack
    reached = linked[0]
    for _ in sizes:
        reached = linked[reached].any(axis=0)
    if not reached.all():
        raise SceneError(
            f"number {int(np.argmin(reached))} of the union does not overlap the others; move it closer"
        )
    return points, sizes


def require_exposed(owners: np.ndarray, count: int, kind: str) -> None:
    """Refuse discs or spheres that do not show."""
    hidden = np.setdiff1d(np.arange(count), owners)
    if len(hidden):
        raise SceneError(f"{kind} {hidden[0]} of the union lies within the others; leave it out")
