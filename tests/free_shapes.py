"""Smooth grains and beds in space that a program of one's own may have: given by any function."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.geometry import Solid
from incipient.geometry.contacts import frame_of
from incipient.geometry.shape import Moments
from incipient.geometry.space import surfaces
from incipient.geometry.space.beds import SmoothTerrain
from incipient.geometry.space.grains import triangulated
from incipient.geometry.space.surfaces import Surface

LATITUDES = 48  # of the rule for the integrals of stars: spectral accuracy


@dataclass(frozen=True)
class StarSolid(Solid):
    """A star-shaped grain: distance `radius(direction)` from a pole, smooth and positive.

    `radius` takes unit vectors (n, 3) and returns lengths (n,); its derivatives are differences. The body
    frame is shifted to the centroid.
    """

    radius: Callable[[Floats], Floats]

    @cached_property
    def _about_pole(self) -> Moments:
        """By integrals of powers of r over all directions; x . n dS = r^3 dOmega."""
        weights, directions = sphere_rule(LATITUDES)
        r = np.asarray(self.radius(directions), dtype=float)[:, None]
        return Moments.swept(r * directions, weights[:, None] * r**2 * directions)

    @property
    def moments(self) -> Moments:
        """About the centroid."""
        whole = self._about_pole
        return Moments(whole.volume, np.zeros(3), whole.about_centroid())

    @cached_property
    def pole(self) -> Floats:
        """Where the radius is measured from, in the body frame (3,)."""
        return -self._about_pole.centroid

    @cached_property
    def size(self) -> float:
        """The largest distance of two points of the surface, by sampling and refinement."""
        directions = surfaces.sphere(12).points
        points = self._point(directions)
        apart = np.linalg.norm(points[:, None] - points, axis=2)
        ends = directions[list(np.unravel_index(np.argmax(apart), apart.shape))]
        step, around = 0.1, surfaces.sphere(2).points
        while step > 1e-9:
            tries = [unit(end + step * np.vstack([np.zeros(3), around])) for end in ends]
            first, second = (self._point(directions) for directions in tries)
            apart = np.linalg.norm(first[:, None] - second, axis=2)
            i, j = np.unravel_index(np.argmax(apart), apart.shape)
            ends, step = np.array([tries[0][i], tries[1][j]]), step if i + j > 0 else 0.5 * step
        return float(apart.max())

    def _point(self, directions: Floats) -> Floats:
        """Points of the surface (n, 3) in unit directions from the pole."""
        return self.pole + np.asarray(self.radius(directions), dtype=float)[:, None] * directions

    def level(self, x: ArrayLike) -> Floats:
        """The distance from the pole less the radius in that direction, at points (n, 3)."""
        away = rows(x) - self.pole
        return np.asarray(np.linalg.norm(away, axis=1) - self.radius(unit(away)))

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 3) of the level function at points (n, 3)."""
        away = rows(x) - self.pole
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        outward = unit(away)
        gradient = outward.copy()
        for tangent in frame_of(outward):
            gradient -= tangent * (self._rate(outward, tangent) / length)[:, None]
        return unit(gradient)

    def _rate(self, outward: Floats, tangent: Floats) -> Floats:
        """The derivative of the radius (n,) as the direction turns towards a unit tangent."""
        h = 1e-3

        def difference(angle: float) -> Floats:
            """The difference of the radii (n,) at this angle on either side."""
            ahead, aside = np.cos(angle) * outward, np.sin(angle) * tangent
            return np.asarray(self.radius(ahead + aside)) - np.asarray(self.radius(ahead - aside))

        return np.asarray((8.0 * difference(h) - difference(2.0 * h)) / (12.0 * h))

    def project(self, x: ArrayLike) -> Floats:
        """The points (n, 3) of the surface on the rays from the pole through points (n, 3)."""
        return self._point(unit(rows(x) - self.pole))

    def surface(self, spacing: float) -> Surface:
        """A sphere's triangles, carried along rays onto the surface."""
        return triangulated(self._point, self.size, spacing)


@dataclass(frozen=True)
class Relief(SmoothTerrain):
    """z = origin_z + function(x) for any smooth function of points (n, 2) that returns heights (n,).

    `feature` is the smallest horizontal length of its shape; derivatives are differences over parts of it
    (first ones with an error of about 1e-12, second ones of 1e-8 of the heights).
    """

    crest = np.inf  # not known of a function
    function: Callable[[Floats], Floats]
    feature_length: float
    origin_z: float = 0.0

    @property
    def feature(self) -> float:
        """`feature_length`."""
        return self.feature_length

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return np.asarray(self.origin_z + np.asarray(self.function(rows(x)), dtype=float))

    def gradient(self, x: ArrayLike) -> Floats:
        """Central differences of fourth order, (n, 2)."""
        h = 1e-3 * self.feature_length
        return np.column_stack([_fourth_order(self.height, rows(x), h * e) / h for e in np.eye(2)])

    def hessian(self, x: ArrayLike) -> Floats:
        """Central differences of the first derivatives, (n, 2, 2)."""
        h = 1e-3 * self.feature_length
        second = np.stack(
            [_fourth_order(self.gradient, rows(x), h * e) / h for e in np.eye(2)], axis=2
        )
        return np.asarray(0.5 * (second + np.swapaxes(second, 1, 2)))


def _fourth_order(function: Callable[[Floats], Floats], x: Floats, step: Floats) -> Floats:
    """The change of a function per step, by differences of fourth order."""
    near = function(x + step) - function(x - step)
    far = function(x + 2.0 * step) - function(x - 2.0 * step)
    return np.asarray((8.0 * near - far) / 12.0)


def sphere_rule(count: int) -> tuple[Floats, Floats]:
    """Weights (n,) and unit directions (n, 3): `count` Gauss points in latitude, twice as many in longitude."""
    z, latitude = np.polynomial.legendre.leggauss(count)
    angle = np.pi * np.arange(2 * count) / count
    weights, circle = (
        np.full(2 * count, np.pi / count),
        np.column_stack([np.cos(angle), np.sin(angle)]),
    )
    ring = np.sqrt(1.0 - z**2)[:, None, None] * circle
    height = np.broadcast_to(z[:, None, None], (count, 2 * count, 1))
    return np.outer(latitude, weights).ravel(), np.concatenate([ring, height], axis=2).reshape(
        -1, 3
    )
