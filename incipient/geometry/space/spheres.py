"""Unions of spheres as grains: what shows of each sphere, and their integrals by plane sections."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from incipient.arrays import Floats, cross
from incipient.geometry import moments
from incipient.geometry.balls import Balls, checked_balls, require_exposed
from incipient.geometry.moments import Moments
from incipient.geometry.plane.discs import exposed_arcs
from incipient.geometry.space import surfaces
from incipient.geometry.space.solid import Core, Solid
from incipient.geometry.space.surfaces import Surface

SECTION_NODES = 24  # Gauss points between heights at which the section changes its topology
Triple = tuple[float, float, float]


@dataclass(frozen=True, init=False)
class Spheres(Balls, Solid):
    """Spheres that hang together; they are shifted to the centroid of their union.

    Raises SceneError if the numbers are no spheres, or if a sphere touches no other or lies within another.
    """

    level_is_distance = True
    centres: tuple[Triple, ...]
    radii: tuple[float, ...]

    def __init__(
        self, centres: Sequence[Sequence[float]] | Floats, radii: Sequence[float] | Floats
    ) -> None:
        points, sizes = checked_balls(centres, radii, 3)
        require_exposed(_showing(points, sizes), len(sizes), "sphere")
        points = points - _union(points, sizes).centroid
        object.__setattr__(
            self, "centres", tuple((float(x), float(y), float(z)) for x, y, z in points)
        )
        object.__setattr__(self, "radii", tuple(float(r) for r in sizes))

    @cached_property
    def _moments(self) -> Moments:
        """Volume, centroid and moments, by plane sections, relative error about 1e-9."""
        return _union(np.array(self.centres), np.array(self.radii))

    @property
    def cores(self) -> tuple[Core, ...]:
        """The centres."""
        point = np.zeros((1, 3), dtype=int)
        return tuple(
            Core(np.array([c]), point, r) for c, r in zip(self.centres, self.radii, strict=True)
        )

    def surface(self, spacing: float) -> Surface:
        """The spheres' triangles as far as they show; triangles that cross a crease are left whole."""
        frequency = max(4, int(np.ceil(1.3 * max(self.radii) / spacing)))
        frequency = min(frequency, int(np.sqrt(0.1 * surfaces.MOST_POINTS / len(self.radii))))
        ball = surfaces.sphere(frequency)
        pieces = []
        for centre, radius in zip(self.centres, self.radii, strict=True):
            points = np.asarray(centre) + radius * ball.points
            shows = (self.level(points) >= -1e-9 * radius)[ball.triangles].any(axis=1)
            used, numbers = np.unique(ball.triangles[shows], return_inverse=True)
            pieces.append(Surface(points[used], numbers.reshape(-1, 3)))
        return surfaces.joined(pieces)


def _showing(centres: Floats, radii: Floats) -> np.ndarray:
    """The spheres that lie within no other; of equal ones the last."""
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    first, second = np.meshgrid(np.arange(len(radii)), np.arange(len(radii)), indexing="ij")
    larger = (radii > radii[:, None]) | ((radii == radii[:, None]) & (second > first))
    within = (apart <= radii - radii[:, None] + 1e-12 * radii) & larger
    return np.flatnonzero(~within.any(axis=1))


def _union(centres: Floats, radii: Floats) -> Moments:
    """Integrals over a union of spheres: unions of discs at Gauss points along the third axis."""
    z, weights = _section_rule(centres, radii)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for height, weight in zip(z, weights, strict=True):
        section = _section(height, centres, radii)
        volume += weight * section.volume
        first += weight * np.array([*section.first, height * section.volume])
        part = np.zeros((3, 3))
        part[:2, :2] = section.second
        part[2, :2] = part[:2, 2] = height * section.first
        part[2, 2] = height**2 * section.volume
        second += weight * part
    return Moments(volume, first, second)


def _section(height: float, centres: Floats, radii: Floats) -> Moments:
    """The integrals over the union of discs in which a horizontal plane cuts spheres."""
    squared = radii**2 - (height - centres[:, 2]) ** 2
    cut = squared > 0.0
    middles, sizes = centres[cut, :2], np.sqrt(squared[cut])
    arcs = exposed_arcs(middles, sizes)
    return moments.sector_sum(middles[arcs.owner], sizes[arcs.owner], arcs.start, arcs.end)


def _section_rule(centres: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Heights and weights (n,) of Gauss rules between the heights at which sections change.

    A cubic change of variable softens the square roots at the ends of the intervals.
    """
    stations = np.unique(np.round(_critical_heights(centres, radii), 12))
    t, w = np.polynomial.legendre.leggauss(SECTION_NODES)
    middle, half = 0.5 * (stations[1:] + stations[:-1]), 0.5 * np.diff(stations)
    z = middle[:, None] + half[:, None] * (1.5 * t - 0.5 * t**3)
    weights = half[:, None] * (1.5 - 1.5 * t**2) * w
    return z.ravel(), weights.ravel()


def _critical_heights(centres: Floats, radii: Floats) -> Floats:
    """Heights of the spheres' poles, of the extremes of the circles in which they meet, of triple points."""
    low, high = (centres[:, 2] - radii).min(), (centres[:, 2] + radii).max()
    heights = [*(centres[:, 2] - radii), *(centres[:, 2] + radii)]
    for i, j in combinations(range(len(radii)), 2):
        circle = _meeting_circle(centres[i], radii[i], centres[j], radii[j])
        if circle is not None:
            middle, axis, radius = circle
            reach = radius * np.sqrt(max(1.0 - axis[2] ** 2, 0.0))
            heights += [middle[2] - reach, middle[2] + reach]
            heights += [
                z
                for k in range(j + 1, len(radii))
                for z in _circle_on_sphere(middle, axis, radius, centres[k], radii[k])
            ]
    found = np.array(heights)
    return found[(found >= low) & (found <= high)]


def _meeting_circle(
    first: Floats, r: float, second: Floats, s: float
) -> tuple[Floats, Floats, float] | None:
    """Centre, axis and radius of the circle in which two spheres meet."""
    d = float(np.linalg.norm(second - first))
    if not abs(r - s) < d < r + s:
        return None
    axis = (second - first) / d
    along = (d * d + r * r - s * s) / (2.0 * d)
    return first + along * axis, axis, float(np.sqrt(r * r - along * along))


def _circle_on_sphere(
    middle: Floats, axis: Floats, radius: float, centre: Floats, r: float
) -> list[float]:
    """Heights of the points in which a circle meets a sphere."""
    away = centre - middle
    across = away - (away @ axis) * axis
    length = float(np.linalg.norm(across))
    if length < 1e-12 * radius:
        return []
    cosine = (away @ away + radius**2 - r * r) / (2.0 * radius * length)
    if abs(cosine) > 1.0:
        return []
    ahead = across / length
    aside = cross(axis, ahead)
    sine = np.sqrt(1.0 - cosine**2)
    return [float((middle + radius * (cosine * ahead + s * sine * aside))[2]) for s in (-1.0, 1.0)]
