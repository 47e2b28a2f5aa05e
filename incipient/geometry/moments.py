"""Integrals of 1, x and x x^T over shapes: volumes, centroids and inertia of grains of unit density.

In the plane a volume is an area. All functions know no shapes but those of elementary calculus.
"""

from dataclasses import dataclass
from itertools import product as choices
from math import gamma

import numpy as np

from incipient.arrays import Floats

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, eq=False)
class Moments:
    """Volume, first moments (d,) and second moments (d, d), the integrals of 1, x and x x^T."""

    volume: float
    first: Floats
    second: Floats

    @property
    def centroid(self) -> Floats:
        """The centre of mass of a uniform body, (d,)."""
        return self.first / self.volume

    def about_centroid(self) -> Floats:
        """The second moments (d, d) about the centroid."""
        return self.second - self.volume * np.outer(self.centroid, self.centroid)


def inertia_of(second: Floats) -> Floats:
    """The inertia (3, 3) of unit density from second moments (d, d); in the plane only its 33 component."""
    if len(second) == 2:
        polar = np.zeros((3, 3))
        polar[2, 2] = np.trace(second)
        return polar
    return np.asarray(np.trace(second) * np.eye(3) - second)


def dirichlet(powers: tuple[float, float], exponent: float) -> float:
    """The integral of u^(p-1) v^(q-1) over u, v > 0, u^n + v^n <= 1 (Dirichlet 1839)."""
    p, q = powers
    n = exponent
    return gamma(p / n) * gamma(q / n) / (n * n * gamma(1.0 + (p + q) / n))


def rounded_box(core: Floats, radius: float) -> Moments:
    """A box (rectangle) with half sides `core` (d,), swept by a ball (disc) of a radius; about its centre.

    It is cut into cells: along each axis a point is either beside the core or beyond it.
    """
    d = len(core)
    volume, second = 0.0, np.zeros(d)
    for beyond in choices((False, True), repeat=d):
        out = np.array(beyond)
        cell, first, square = _orthant(int(out.sum()), radius)
        beside = float(np.prod(2.0 * core[~out]))
        copies = 2.0 ** out.sum()
        volume += copies * beside * cell
        along = np.where(out, core**2 * cell + 2.0 * core * first + square, core**2 / 3.0 * cell)
        second += copies * beside * along
    return Moments(volume, np.zeros(d), np.diag(second))


def _orthant(dimension: int, r: float) -> tuple[float, float, float]:
    """Integrals of 1, x and x^2 over the part of a ball of radius r with all coordinates positive."""
    return (
        (1.0, 0.0, 0.0),
        (r, r**2 / 2.0, r**3 / 3.0),
        (np.pi * r**2 / 4.0, r**3 / 3.0, np.pi * r**4 / 16.0),
        (np.pi * r**3 / 6.0, np.pi * r**4 / 16.0, np.pi * r**5 / 30.0),
    )[dimension]


def polygon(corners: Floats) -> Moments:
    """A polygon with corners (n, 2) in counter-clockwise order: triangles that share the origin."""
    return within(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))


def within(corners: Floats) -> Moments:
    """The inside of a closed surface of triangles (m, 3 corners, 3), counter-clockwise seen from outside.

    In the plane of sides (m, 2 ends, 2): signed simplices whose further corner is the origin.
    """
    d = corners.shape[-1]
    content = np.linalg.det(corners) / gamma(d + 1.0)
    total = corners.sum(axis=1)
    first = (content[:, None] * total).sum(axis=0) / (d + 1.0)
    squares = np.einsum("mi,mj->mij", total, total) + np.einsum("mki,mkj->mij", corners, corners)
    second = (content[:, None, None] * squares).sum(axis=0) / ((d + 1.0) * (d + 2.0))
    return Moments(float(content.sum()), first, second)


def sector_sum(centres: Floats, radii: Floats, starts: Floats, ends: Floats) -> Moments:
    """The region that circular arcs (k,) enclose, from angle `starts` to `ends`, counter-clockwise around it.

    Green's theorem with a Gauss rule of 16 points on pieces of at most a quarter turn: exact to round-off.
    """
    counts = np.maximum(np.ceil((ends - starts) / (0.5 * np.pi)).astype(int), 1)
    index = np.repeat(np.arange(len(radii)), counts)
    piece = np.concatenate([np.arange(count) for count in counts]) if len(counts) else np.empty(0)
    half = (0.5 * (ends - starts) / counts)[index]
    middle = starts[index] + (2.0 * piece + 1.0) * half
    angle = middle[:, None] + half[:, None] * NODES
    r = radii[index][:, None]
    x = centres[index, 0][:, None] + r * np.cos(angle)
    y = centres[index, 1][:, None] + r * np.sin(angle)
    w = half[:, None] * WEIGHTS
    dx, dy = -r * np.sin(angle) * w, r * np.cos(angle) * w
    area = 0.5 * float((x * dy - y * dx).sum())
    first = np.array([(0.5 * x * x * dy).sum(), -(0.5 * y * y * dx).sum()])
    mixed = (0.5 * x * x * y * dy).sum()
    second = np.array([[(x**3 * dy).sum() / 3.0, mixed], [mixed, -(y**3 * dx).sum() / 3.0]])
    return Moments(area, first, second)


def star_shape(weights: Floats, directions: Floats, radii: Floats) -> Moments:
    """A star-shaped body about its pole, from its radii (n,) in unit directions (n, d) with a rule of weights."""
    d = directions.shape[1]
    volume = float(weights @ radii**d) / d
    first = (weights * radii ** (d + 1)) @ directions / (d + 1)
    second = np.einsum("n,ni,nj->ij", weights * radii ** (d + 2), directions, directions) / (d + 2)
    return Moments(volume, first, second)


def circle_rule(count: int) -> tuple[Floats, Floats]:
    """Weights (n,) and unit directions (n, 2) of the trapezoidal rule on the circle."""
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.full(count, 2.0 * np.pi / count), np.column_stack([np.cos(angle), np.sin(angle)])
