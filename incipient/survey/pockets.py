"""The exposed grains of a bed: contacts with fixed neighbours, protrusion, shelter and pivot angle.

Positions are relative to the grain's centre, with x in the direction of the flow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import Floats, unit
from ..contact import Contacts, Load
from ..contact.friction import Law
from ..contact.safety import safety_factor
from ..errors import SceneError
from ..geometry.space.beds import SphereBed
from .beds import DOWN, FLOOR, Spheres, rolled
from .request import FlowPast, Surveyed

TOUCHING = 1e-6  # of the diameter: gaps of contacts
ACROSS = 12  # points of the raster of the bed along the smallest diameter
MOST_POINTS = 10**8  # of it, which take some 6 GiB
MARGIN = 3.0  # median diameters from the edge of a measured bed within which no grain is surveyed
AHEAD = 3.0  # diameters upstream and downstream over which neighbours shelter
DISC = 24  # points across the disc by which shelter is measured


@dataclass(frozen=True, eq=False)
class Surface:
    """The upper side of a bed.

    level: its mean height; visible: fraction (n,) of each sphere's area in plan that is visible from above
    median: diameter of the median sphere; inside: whether spheres (n,) are far enough from the edge, which for a
        measured bed is the convex hull of the centres
    """

    level: float
    visible: Floats
    median: float
    inside: np.ndarray
    deviation: float

    @classmethod
    def of(cls, spheres: Spheres) -> Surface:
        centres, radii = spheres.centres, spheres.radii
        median, low, high = 2.0 * float(np.median(radii)), np.zeros(2), spheres.period
        margin = MARGIN * median
        if high is None:
            low, high = centres[:, :2].min(axis=0) + margin, centres[:, :2].max(axis=0) - margin
        counts = np.maximum(np.ceil((high - low) * ACROSS / (2.0 * float(radii.min()))), 2.0)
        if counts.prod() > MOST_POINTS:
            size = " x ".join(f"{extent:g}" for extent in high - low)
            raise SceneError(
                f"bed: its surface, {size}, takes {counts.prod():.2g} points, {ACROSS} across the smallest grain, more "
                f"than {MOST_POINTS:.2g}; give a smaller one, or leave out its smallest grains"
            )
        cell = (high - low) / counts
        sides = [
            a + step * (np.arange(n) + 0.5) for a, step, n in zip(low, cell, counts, strict=True)
        ]
        points = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
        inside = _within(spheres, margin, centres)
        points = points[_within(spheres, margin, points)]
        if not (inside.any() and len(points)):
            raise SceneError(
                f"bed: is less than {2 * MARGIN:g} median grains wide; give a larger one"
            )
        middle = np.array([*(0.5 * (low + high)), 0.0])
        images, which = spheres.around(middle, 0.5 * float(np.linalg.norm(high - low)))
        heap = SphereBed(images, radii[which], float((images[:, 2] - radii[which]).min()))
        heights, seen = heap.height(points), heap.highest(points)
        counted = np.bincount(which[seen[seen >= 0]], minlength=len(spheres))
        visible = counted * cell.prod() / (np.pi * radii**2)
        return cls(float(heights.mean()), visible, median, inside, float(heights.std()))


def _within(spheres: Spheres, margin: float, points: Floats) -> np.ndarray:
    """Whether points (m, 2 or more) are within the convex hull of the centres in plan, a margin from its edge.

    All are where the bed is periodic.
    """
    from scipy.spatial import ConvexHull  # which takes time to import

    if spheres.period is not None:
        return np.ones(len(points), dtype=bool)
    # Joggled (QJ), spheres in a row also have a hull.
    sides = ConvexHull(spheres.centres[:, :2], qhull_options="QJ").equations
    return np.asarray((points[:, :2] @ sides[:, :2].T + sides[:, 2] < -margin).all(axis=1))


@dataclass(frozen=True, eq=False)
class Pocket:
    """A grain and its surroundings. Lengths but those of the first five fields are in diameters of the grain.

    number: of the sphere; centre (3,) in the bed's own frame
    neighbours (k, 3), relative to it in the frame of the flow, and their radii (k,); contacts: in the same frame
    protrusion: top above the bed's mean level; exposure: above the tops upstream of it
    sheltered, backed: fraction of its disc across the flow hidden upstream, downstream; skew: left less right
    visible: fraction of its area in plan visible from above
    carries: number of grains that rest on it; shifted: distance moved to rest on its neighbours
    pivot: angle [degrees] whose tangent is the force along the flow, through the centre, over the weight, that moves it
        without friction; critical_force: that force with friction, infinite if none moves it
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


def exposed(spheres: Spheres, surface: Surface, which: Surveyed) -> np.ndarray:
    """Numbers of the exposed grains, ascending; a random choice of the requested number."""
    numbers = np.flatnonzero(surface.inside & (surface.visible >= which.visible))
    if which.most is not None and len(numbers) > which.most:
        random = np.random.default_rng([which.seed, 2])
        return np.sort(random.choice(numbers, which.most, replace=False))
    return numbers


def pockets(
    spheres: Spheres, surface: Surface, numbers: np.ndarray, flow: FlowPast
) -> Iterator[Pocket]:
    """The exposed grains that rest on their neighbours, one after the other, without those on a floor.

    Measured grains are first lowered onto their neighbours; those that end farther than a quarter of a diameter from
    their measured position are omitted.
    """
    to_flow = Rotation.from_euler("z", -flow.azimuth, degrees=True)
    for number in numbers.tolist():
        centre, shifted, others = spheres.centres[number], 0.0, spheres.without(number)
        radius = float(spheres.radii[number])
        if spheres.period is None:
            try:
                rest = rolled(others, np.array([*centre[:2], np.inf]), radius)
            except SceneError:
                continue
            shifted, centre = float(np.linalg.norm(rest - centre)) / (2.0 * radius), rest
        size = 2.0 * radius
        images, which = others.around(centre, 4.0 * max(size, surface.median))
        near, radii = to_flow.apply(images - centre), others.radii[which]
        touches = np.linalg.norm(near, axis=1) - radii - radius < TOUCHING * size
        on_floor = spheres.period is not None and centre[2] - radius < FLOOR + TOUCHING * size
        if shifted > 0.25 or on_floor:
            continue
        normals, top = unit(near[touches]), surface.level - centre[2]
        contacts = Contacts(radius * normals, normals)
        beside = np.abs(near[:, 1]) < radius + radii
        ahead = beside & (near[:, 0] < 0.0) & (near[:, 0] > -AHEAD * size)
        highest = max(float((near[:, 2] + radii)[ahead].max(initial=-np.inf)), top)
        sheltered, skew = _hidden(near, radii, radius, -1.0)
        yield Pocket(
            number=number,
            centre=centre,
            diameter=size,
            neighbours=near,
            radii=radii,
            contacts=contacts,
            protrusion=(radius - top) / size,
            exposure=(radius - highest) / size,
            sheltered=sheltered,
            backed=_hidden(near, radii, radius, 1.0)[0],
            skew=skew,
            visible=float(surface.visible[number]),
            carries=int((near[touches, 2] > TOUCHING * size).sum()),
            shifted=shifted,
            pivot=float(np.degrees(np.arctan(critical_force(contacts, 0.0)))),
            critical_force=critical_force(contacts, flow.law(size / surface.median, 1.0)),
        )


def critical_force(contacts: Contacts, law: Law) -> float:
    """Force along x, through the centre, over the weight at which a grain moves, by the exact criterion.

    Infinite if no such force moves it, NaN if the weight alone does.
    """
    safety = safety_factor(Load(np.eye(3)[0], np.zeros(3), DOWN, np.zeros(3)), contacts, law)
    moves = safety.interval is None or safety.interval[0] > 0.0
    return float("nan") if moves else safety.value


def _hidden(near: Floats, radii: Floats, radius: float, sign: float) -> tuple[float, float]:
    side = radius * (2.0 * (np.arange(DISC) + 0.5) / DISC - 1.0)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    points = points[np.linalg.norm(points, axis=1) < radius]
    along = sign * near[:, 0]
    mine = (along > 0.0) & (along < 2.0 * AHEAD * radius)
    away = np.linalg.norm(points[:, None] - near[mine, 1:], axis=2)
    hidden = (away < radii[mine]).any(axis=1)
    return float(hidden.mean()), float(np.mean(hidden * np.sign(points[:, 0])))
