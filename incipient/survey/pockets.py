"""The exposed grains of a bed: where their neighbours touch them, how far they stand out, and how firmly they lie.

Places are relative to the grain's centre, in a frame whose x is the direction of the flow. Neighbours are held.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, unit
from ..contact import Contacts, Load
from ..contact.safety import safety_factor
from ..errors import SceneError
from ..geometry.space.beds import SphereBed
from .deposition import DOWN, Spheres, rolled
from .request import FlowPast, Surveyed

TOUCHING = 1e-6  # of the diameter: gaps of contacts
ACROSS = 12  # points of the raster of the bed along the smallest diameter
MOST_POINTS = 10**8  # of it, which take some 6 GiB
MARGIN = 3.0  # median diameters from the edge of a measured bed within which no grain is surveyed
SHIFTED = (
    0.25  # of the diameter by which a measured grain may have to move to rest on its neighbours
)
AHEAD = 3.0  # diameters up and down the stream over which neighbours shelter
DISC = 24  # points across the disc by which shelter is measured
AROUND = 4.0  # diameters about a grain over which its neighbours are looked at


@dataclass(frozen=True, eq=False)
class Surface:
    """The upper side of a bed.

    level: its mean height; visible: share (n,) of each sphere's area in plan that is seen from above
    median: diameter of the median sphere; inside: spheres (n,) that are far enough from the edge
    """

    level: float
    visible: Floats
    median: float
    inside: np.ndarray
    deviation: float

    @classmethod
    def of(cls, spheres: Spheres) -> Surface:
        """The surface of a bed, by a raster of heights."""
        low, high = spheres.centres[:, :2].min(axis=0), spheres.centres[:, :2].max(axis=0)
        median = 2.0 * float(np.median(spheres.radii))
        inside = np.ones(len(spheres), dtype=bool)
        if spheres.period is not None:
            low, high = np.zeros(2), spheres.period
        else:
            low, high = low + MARGIN * median, high - MARGIN * median
            inside = ((spheres.centres[:, :2] > low) & (spheres.centres[:, :2] < high)).all(axis=1)
            if not inside.any():
                raise SceneError(
                    f"bed: is less than {2 * MARGIN:g} median grains wide; give a larger one"
                )
        step = 2.0 * float(spheres.radii.min()) / ACROSS
        wanted = np.maximum(np.ceil((high - low) / step), 2.0)
        if wanted.prod() > MOST_POINTS:
            size = " x ".join(f"{extent:g}" for extent in high - low)
            raise SceneError(
                f"bed: its surface, {size}, takes {wanted.prod():.2g} points, {ACROSS} across the smallest grain, more "
                f"than {MOST_POINTS:.2g}; give a smaller one, or leave out its smallest grains"
            )
        counts = wanted.astype(int)
        sides = [
            a + (b - a) * (np.arange(n) + 0.5) / n
            for a, b, n in zip(low, high, counts, strict=True)
        ]
        middle = np.array([*(0.5 * (low + high)), 0.0])
        centres, which = spheres.around(middle, 0.5 * float(np.linalg.norm(high - low)))
        heap = SphereBed(
            centres, spheres.radii[which], float((centres[:, 2] - spheres.radii[which]).min())
        )
        points = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
        heights, seen = heap.height(points), heap.highest(points)
        cell = float(np.prod((high - low) / counts))
        counted = np.bincount(which[seen[seen >= 0]], minlength=len(spheres))
        visible = counted * cell / (np.pi * spheres.radii**2)
        return cls(float(heights.mean()), visible, median, inside, float(heights.std()))


@dataclass(frozen=True, eq=False)
class Pocket:
    """A grain and what is around it.

    number: of the sphere; centre (3,) in the bed's own frame; diameter
    neighbours (k, 3) relative to it in the frame of the flow, their radii (k,); contacts: likewise
    protrusion: its top above the bed's mean level; exposure: above the tops of what is ahead of it up the stream
    sheltered, backed: share of its disc across the flow that is hidden up and down the stream; skew: left less right
    visible: share of its area in plan that is seen from above; lengths are in diameters of the grain
    carries: number of grains that rest on it; shifted: how far it was moved to rest on its neighbours
    pivot: angle whose tangent is the force along the flow, through the centre, over the weight, that moves it without
        friction [degrees]; critical_force: that force over the weight with friction, infinite where none moves it
    """

    number: int
    centre: Floats
    diameter: float
    neighbours: Floats
    radii: Floats
    contacts: Contacts
    protrusion: float
    exposure: float
    sheltered: float
    backed: float
    skew: float
    visible: float
    carries: int
    shifted: float
    pivot: float
    critical_force: float

    @property
    def features(self) -> Floats:
        """What the emulator knows of the grain but for its size and Reynolds number, (5,)."""
        return np.array([self.protrusion, self.exposure, self.sheltered, self.backed, self.skew])


def turn(azimuth: float) -> Floats:
    """The matrix (3, 3) that takes vectors of the bed, in rows from the left, to the frame of the flow."""
    c, s = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def exposed(spheres: Spheres, surface: Surface, asked: Surveyed) -> np.ndarray:
    """Numbers of the exposed grains, ascending; of more than are asked for a random choice."""
    found = np.flatnonzero(surface.inside & (surface.visible >= asked.visible))
    if asked.most is not None and len(found) > asked.most:
        found = np.sort(
            np.random.default_rng([asked.seed, 2]).choice(found, asked.most, replace=False)
        )
    return found


def pockets(
    spheres: Spheres, surface: Surface, numbers: np.ndarray, flow: FlowPast
) -> Iterator[Pocket]:
    """The exposed grains that rest on their neighbours, one after the other.

    Measured grains, whose neighbours need not touch, are first let down onto these from above; those that get farther
    than a quarter of a diameter from where they were measured are left out.
    """
    for number in numbers.tolist():
        centre, shifted, others = spheres.centres[number], 0.0, spheres.without(number)
        radius = float(spheres.radii[number])
        if spheres.period is None:
            try:
                rest = rolled(others, np.array([*centre[:2], np.inf]), radius)
            except SceneError:
                continue
            shifted = float(np.linalg.norm(rest - centre)) / (2.0 * radius)
            if shifted > SHIFTED:
                continue
            centre = rest
        found = _pocket(number, centre, radius, others, surface, flow)
        if found is not None:
            yield Pocket(**found, visible=float(surface.visible[number]), shifted=shifted)


def _pocket(
    number: int, centre: Floats, radius: float, others: Spheres, surface: Surface, flow: FlowPast
) -> dict[str, Any] | None:
    size = 2.0 * radius
    images, which = others.around(centre, AROUND * max(size, surface.median))
    near, radii = (images - centre) @ turn(flow.azimuth), others.radii[which]
    touches = np.linalg.norm(near, axis=1) - radii - radius < TOUCHING * size
    if not touches.any():
        return None
    normals = unit(near[touches])
    contacts = Contacts(radius * normals, normals)
    top, hidden = surface.level - centre[2], _Shelter(near, radii, radius)
    ahead = (
        (near[:, 0] < 0.0) & (near[:, 0] > -AHEAD * size) & (np.abs(near[:, 1]) < radius + radii)
    )
    highest = max(float((near[:, 2] + radii)[ahead].max(initial=-np.inf)), top)
    return {
        "number": number,
        "centre": centre,
        "diameter": size,
        "neighbours": near,
        "radii": radii,
        "contacts": contacts,
        "protrusion": (radius - top) / size,
        "exposure": (radius - highest) / size,
        "sheltered": hidden.share(-1.0),
        "backed": hidden.share(1.0),
        "skew": hidden.skew,
        "carries": int((near[touches, 2] > TOUCHING * size).sum()),
        "pivot": float(np.degrees(np.arctan(critical_force(contacts, 0.0)))),
        "critical_force": critical_force(contacts, flow.friction),
    }


def critical_force(contacts: Contacts, friction: float) -> float:
    """The force along x, through the centre, over the weight at which a grain moves, by the exact judge.

    Infinite where no such force moves it, NaN where the weight alone does.
    """
    load = Load(np.array([1.0, 0.0, 0.0]), np.zeros(3), DOWN, np.zeros(3))
    found = safety_factor(load, contacts, friction)
    return float("nan") if found.interval is None or found.interval[0] > 0.0 else found.value


@dataclass(frozen=True, eq=False)
class _Shelter:
    """What hides the disc of a grain across the flow: points of it, and neighbours."""

    near: Floats
    radii: Floats
    radius: float

    def _hidden(self, sign: float) -> tuple[Floats, np.ndarray]:
        """Points (m, 2) across and upwards, and which of them are hidden on one side, up the stream being -1."""
        side = self.radius * (2.0 * (np.arange(DISC) + 0.5) / DISC - 1.0)
        points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        points = points[np.linalg.norm(points, axis=1) < self.radius]
        along = sign * self.near[:, 0]
        mine = (along > 0.0) & (along < 2.0 * AHEAD * self.radius)
        away = np.linalg.norm(points[:, None] - self.near[mine, 1:], axis=2)
        return points, (away < self.radii[mine]).any(axis=1)

    def share(self, sign: float) -> float:
        """The share that is hidden on one side."""
        return float(self._hidden(sign)[1].mean())

    @property
    def skew(self) -> float:
        """The share hidden up the stream at the left, where y is positive, less that at the right."""
        points, hidden = self._hidden(-1.0)
        return float(np.mean(hidden * np.sign(points[:, 0])))
