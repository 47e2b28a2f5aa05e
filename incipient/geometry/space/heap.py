"""A bed of spheres each of which is where it is given, of any sizes, above a base plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows
from incipient.errors import SceneError
from incipient.geometry.space.nearest import NearestOf
from incipient.geometry.space.pieces import HalfSpacesAndBalls, Pieces
from incipient.geometry.space.terrain import Terrain

FEW = 20_000  # pairs of points and spheres up to which all are looked at


@dataclass(frozen=True, init=False, eq=False)
class SphereHeap(Terrain):
    """Spheres with given centres (k, 3) and radii (k,), and the half-space below the plane z = origin_z.

    Those that are `posts` (k,) reach down to the plane as cylinders, so that no pores are below them. The bed's solid
    is the union; heights are those of its upper side. Raises SceneError if a number is not finite or a radius not
    positive.
    """

    centres: Floats
    radii: Floats
    origin_z: float
    posts: np.ndarray

    def __init__(
        self,
        centres: ArrayLike,
        radii: ArrayLike,
        origin_z: float = 0.0,
        posts: ArrayLike | None = None,
    ) -> None:
        points, sizes = (
            np.array(centres, dtype=float).reshape(-1, 3),
            np.array(radii, dtype=float).ravel(),
        )
        if len(points) != len(sizes) or not len(sizes):
            raise SceneError(
                f"{len(points)} centres and {len(sizes)} radii; give as many of both, one or more"
            )
        if not (np.isfinite(points).all() and np.isfinite(sizes).all() and (sizes > 0.0).all()):
            raise SceneError(
                "centres and radii are not finite or not positive; give finite, positive numbers"
            )
        standing = (
            np.zeros(len(sizes), dtype=bool) if posts is None else np.array(posts, dtype=bool)
        )
        given = {"centres": points, "radii": sizes, "origin_z": float(origin_z), "posts": standing}
        for name, value in given.items():
            object.__setattr__(self, name, value)

    @property
    def feature(self) -> float:
        """The smallest radius, of a sphere if there is one."""
        return float(self.radii[self.posts if self.posts.all() else ~self.posts].min())

    @cached_property
    def crest(self) -> float:
        """The top of the highest sphere, or the base plane."""
        return max(float((self.centres[:, 2] + self.radii).max()), self.origin_z)

    def crest_level(self, x: Sequence[float], y: Sequence[float]) -> float:
        """The height that spheres with centres over a rectangle reach."""
        low, high = np.array([x, y]).T
        inside = ((self.centres[:, :2] >= low) & (self.centres[:, :2] <= high)).all(axis=1)
        tops = (self.centres[:, 2] + self.radii)[inside]
        return max(float(tops.max(initial=-np.inf)), self.origin_z)

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The half-space and the spheres of which a part is within a horizontal distance of a point (2,)."""
        away = np.linalg.norm(self.centres[:, :2] - np.asarray(middle, dtype=float), axis=1)
        near = away <= reach + self.radii
        up = np.array([[0.0, 0.0, 1.0]])
        base, posts = (
            np.array([[0.0, 0.0, self.origin_z]]),
            self.posts[near] if self.posts.any() else None,
        )
        return HalfSpacesAndBalls(base, up, self.centres[near], self.radii[near], posts)

    def _highest(self, x: Floats) -> tuple[Floats, np.ndarray]:
        """Heights (n,) at points (n, 2), and which sphere is there, -1 on the base."""
        heights, which = np.full(len(x), self.origin_z), np.full(len(x), -1)
        if len(x) * len(self.radii) < FEW:
            squared = ((x[:, None] - self.centres[:, :2]) ** 2).sum(axis=2)
            tops = self._top(np.arange(len(self.radii)), squared)
            tops[squared > self.radii**2] = -np.inf
            best = tops.argmax(axis=1)
            top = tops[np.arange(len(best)), best]
            higher = top > self.origin_z
            return np.where(higher, top, heights), np.where(higher, best, which)
        matches = NearestOf(x).within(self.centres[:, :2], self.radii)
        for sphere, below in enumerate(matches):
            top = self._top(sphere, ((x[below] - self.centres[sphere, :2]) ** 2).sum(axis=1))
            higher = top > heights[below]
            heights[below[higher]], which[below[higher]] = top[higher], sphere
        return heights, which

    def _top(self, spheres: int | np.ndarray, squared: Floats) -> Floats:
        """Heights of spheres at squared distances beside their centres."""
        return np.asarray(
            self.centres[spheres, 2] + np.sqrt(np.maximum(self.radii[spheres] ** 2 - squared, 0.0))
        )

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return self._highest(rows(x))[0]

    def highest(self, x: ArrayLike) -> np.ndarray:
        """Which sphere is seen from above at points (n, 2), (n,); -1: the base plane."""
        return self._highest(rows(x))[1]

    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2), infinite at the equators of spheres."""
        heights, which = self._highest(rows(x))
        beside = rows(x) - self.centres[which, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = -beside / (heights - self.centres[which, 2])[:, None]
        return np.asarray(np.where((which < 0)[:, None], 0.0, slope))
