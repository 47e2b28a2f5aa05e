"""Beds of spheres by sequential deposition (Visscher & Bolsterli 1972, Nature 239, 504).

A dropped sphere rolls without friction until the normals of its contacts hold its weight; those at rest do not move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..geometry.statics import nearest_motion

DOWN = np.array([0.0, 0.0, -1.0])
# In radii of the sphere that rolls.
STEP, SHORTEST = 0.2, 1e-7
STILL = 1e-6  # speed of a sphere at rest, over the speed of free fall
MOST_STEPS = 5000
AS_FORESEEN = 0.5  # of the descent by the contacts' planes: steps with less are halved


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres with centres (n, 3) and radii (n,), periodic over `period` (2,) in x and y if given."""

    centres: Floats
    radii: Floats
    period: Floats | None = None

    def __len__(self) -> int:
        return len(self.radii)

    def away(self, points: Floats) -> Floats:
        """Vectors (..., n, 3) from the nearest images of the centres to points (..., 3)."""
        vectors = points[..., None, :] - self.centres
        if self.period is not None:
            vectors[..., :2] -= self.period * np.round(vectors[..., :2] / self.period)
        return np.asarray(vectors)

    def without(self, number: int) -> Spheres:
        kept = np.arange(len(self)) != number
        return Spheres(self.centres[kept], self.radii[kept], self.period)

    def around(self, point: Floats, reach: float) -> tuple[Floats, np.ndarray]:
        """Centres (k, 3), images included, and numbers of spheres within a horizontal distance of a point."""
        shifts = np.zeros((1, 2))
        if self.period is not None:
            most = np.ceil((reach + self.radii.max()) / self.period).astype(int)
            steps = np.meshgrid(*(np.arange(-n, n + 1) for n in most))
            shifts = np.stack(steps, axis=-1).reshape(-1, 2) * self.period
        base = point - self.away(point)
        images = np.repeat(base[None], len(shifts), axis=0)
        images[..., :2] += shifts[:, None]
        near = np.linalg.norm(images[..., :2] - point[:2], axis=2) <= reach + self.radii
        return np.asarray(images[near]), np.nonzero(near)[1]


def deposited(radii: Floats, period: Floats, seed: int, tries: int = 1) -> Spheres:
    """A bed of spheres with radii (n,), dropped in this order at positions by a seed. Raises SceneError.

    tries: positions at which each is dropped; the lowest rest counts.
    """
    if min(period) < 8.0 * radii.max():
        raise SceneError(
            f"bed: a box of {min(period):g} is less than four of its grains; enlarge length and width"
        )
    random, centres = np.random.default_rng([seed, 0]), np.empty((0, 3))
    for number, radius in enumerate(radii.tolist()):
        lying = Spheres(centres, radii[:number], period)
        places = random.random((tries, 2)) * period
        rests = [rolled(lying, np.array([*place, np.inf]), radius, floor=0.0) for place in places]
        lowest = min(rests, key=lambda rest: float(rest[2]))
        lowest[:2] %= period
        centres = np.vstack([centres, lowest])
    return Spheres(centres, radii, period)


def rolled(others: Spheres, start: Floats, radius: float, floor: float | None = None) -> Floats:
    """The centre (3,) at which a sphere rests after its release at `start`; infinite height: above all others.

    `floor`: height of a level floor. Raises SceneError if it leaves the others and there is none.
    """
    place, step = _dropped(others, start, radius, floor), STEP * radius
    for _ in range(MOST_STEPS):
        normals, gaps = _near(others, place, radius, 1.5 * step, floor)
        motion = nearest_motion(normals, -np.maximum(gaps, 0.0) / step, DOWN)
        ahead = _dropped(others, place + step * motion, radius, floor)
        descent = place[2] - ahead[2]
        if descent > 0.0:
            place = ahead
        is_as_foreseen = descent > -AS_FORESEEN * step * motion[2]
        step = min(2.0 * step, STEP * radius) if is_as_foreseen else 0.5 * step
        if step < SHORTEST * radius or np.linalg.norm(motion) < STILL:
            return place
    raise SceneError("a sphere did not come to rest; change the seed of the bed")


def _dropped(others: Spheres, place: Floats, radius: float, floor: float | None) -> Floats:
    level = place.copy()
    level[2] = 0.0
    away = others.away(level)
    reach = others.radii + radius
    below = reach**2 - (away[:, :2] ** 2).sum(axis=1)
    tops = others.centres[:, 2] + np.sqrt(np.maximum(below, 0.0))
    # A sphere that is beside another one, below its middle, does not land on it.
    under = (below > 0.0) & (others.centres[:, 2] < place[2] + 1e-12 * radius)
    tops = tops[under & (tops <= place[2] + 1e-6 * radius)]
    lowest = -np.inf if floor is None else floor + radius
    level[2] = max(float(tops.max(initial=-np.inf)), lowest)
    if not np.isfinite(level[2]):
        raise SceneError("a sphere rolls off the bed: give a larger bed")
    return level


def _near(
    others: Spheres, place: Floats, radius: float, within: float, floor: float | None
) -> tuple[Floats, Floats]:
    """Normals (k, 3), and gaps (k,) less than `within`, to the others and the floor."""
    away = others.away(place)
    length = np.linalg.norm(away, axis=1)
    gaps = length - others.radii - radius
    close = gaps < within
    normals, gaps = away[close] / length[close, None], gaps[close]
    if floor is not None and place[2] - radius - floor < within:
        normals, gaps = np.vstack([normals, -DOWN]), np.append(gaps, place[2] - radius - floor)
    return normals, gaps
