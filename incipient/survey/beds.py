"""The grains of a bed as spheres: deposited, or from files of measurements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import center_of_mass, maximum

from ..arrays import Floats, decimal, spatial
from ..errors import SceneError
from ..geometry.contacts import nearest_motion
from ..geometry.space.heightmap import LARGEST_FILE, HeightMap, array_in, require_few
from ..input_files import read_table, reading
from ..scene.section import read_numbers
from .request import Deposited, LabelledHeights, MeasuredEllipsoids, MeasuredSpheres

_G3POINT = ("Xc", "Yc", "Zc", "Dmax", "Dmed", "Dmin")
FEWEST_PIXELS = 12  # of a label that is a grain
DOWN = np.array([0.0, 0.0, -1.0])
FLOOR = 0.0  # height of that of deposited beds
# In radii of the sphere that rolls.
STEP, SHORTEST = 0.2, 1e-7


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
        images = point - self.away(point) + spatial(shifts)[:, None]
        near = np.linalg.norm(images[..., :2] - point[:2], axis=2) <= reach + self.radii
        return np.asarray(images[near]), np.nonzero(near)[1]


def deposited(radii: Floats, period: Floats, seed: int, tries: int = 1) -> Spheres:
    """A bed of spheres with radii (n,), dropped in this order at positions by a seed. Raises SceneError.

    Sequential deposition (Visscher & Bolsterli 1972, Nature 239, 504): each rolls without friction until the normals of
    its contacts hold its weight; those at rest do not move.

    tries: positions at which each is dropped; the lowest rest counts.
    """
    if min(period) < 8.0 * radii.max():
        raise SceneError(
            f"bed: a box of {min(period):g} is less than four of its grains; enlarge length and width"
        )
    random, centres = np.random.default_rng([seed, 0]), np.empty((0, 3))
    for number, radius in enumerate(radii.tolist()):
        lying = Spheres(centres, radii[:number], period)
        rests = [
            rolled(lying, np.array([*place, np.inf]), radius, FLOOR)
            for place in random.random((tries, 2)) * period
        ]
        lowest = min(rests, key=lambda rest: float(rest[2]))
        lowest[:2] %= period
        centres = np.vstack([centres, lowest])
    return Spheres(centres, radii, period)


def rolled(others: Spheres, start: Floats, radius: float, floor: float = -np.inf) -> Floats:
    """The centre (3,) at which a sphere rests after its release at `start`; infinite height: above all others.

    `floor`: height of a level floor. Raises SceneError if it leaves the others without one.
    """
    place, step = _dropped(others, start, radius, floor), STEP * radius
    for _ in range(5000):
        normals, gaps = _near(others, place, radius, 1.5 * step, floor)
        motion = nearest_motion(normals, -np.maximum(gaps, 0.0) / step, DOWN)
        ahead = _dropped(others, place + step * motion, radius, floor)
        descent = place[2] - ahead[2]
        if descent > 0.0:
            place = ahead
        # A step with less than half of the descent along the contacts' planes is halved.
        expected = descent > -0.5 * step * motion[2]
        step = min(2.0 * step, STEP * radius) if expected else 0.5 * step
        if step < SHORTEST * radius or np.linalg.norm(motion) < 1e-6:  # of the speed of free fall
            return place
    raise SceneError("a sphere did not come to rest; change the seed of the bed")


def _dropped(others: Spheres, place: Floats, radius: float, floor: float) -> Floats:
    below = (others.radii + radius) ** 2 - (others.away(place)[:, :2] ** 2).sum(axis=1)
    tops = others.centres[:, 2] + np.sqrt(np.maximum(below, 0.0))
    # A sphere that is beside another one, below its middle, does not land on it.
    under = (below > 0.0) & (others.centres[:, 2] < place[2] + 1e-12 * radius)
    tops = tops[under & (tops <= place[2] + 1e-6 * radius)]
    height = max(float(tops.max(initial=-np.inf)), floor + radius)
    if not np.isfinite(height):
        raise SceneError("a sphere rolls off the bed: give a larger bed")
    return np.array([*place[:2], height])


def _near(
    others: Spheres, place: Floats, radius: float, within: float, floor: float
) -> tuple[Floats, Floats]:
    """Normals (k, 3), and gaps (k,) less than `within`, to the others and the floor."""
    away = others.away(place)
    length = np.linalg.norm(away, axis=1)
    gaps = length - others.radii - radius
    close = gaps < within
    normals, gaps = away[close] / length[close, None], gaps[close]
    if place[2] - radius - floor < within:
        normals, gaps = np.vstack([normals, -DOWN]), np.append(gaps, place[2] - radius - floor)
    return normals, gaps


@singledispatch
def spheres_of(bed: object, base: Path) -> Spheres:
    """The spheres of a section [bed], with files relative to `base`. Raises SceneError."""
    raise NotImplementedError(type(bed).__name__)


@spheres_of.register
def _(bed: Deposited, base: Path) -> Spheres:
    random, radii = np.random.default_rng([bed.seed, 1]), np.full(bed.number, 0.5 * bed.diameter)
    if bed.sizes == "uniform":
        radii *= random.uniform(1.0 - bed.spread, 1.0 + bed.spread, bed.number)
    if bed.sizes == "lognormal":
        # Truncated at two standard deviations: a rare giant would be as large as the bed.
        radii *= (1.0 + bed.spread) ** np.clip(random.standard_normal(bed.number), -2.0, 2.0)
    return deposited(radii, np.array([bed.length, bed.width]), bed.seed, bed.tries)


@spheres_of.register
def _(bed: MeasuredSpheres, base: Path) -> Spheres:
    rows = np.array(read_numbers(base / bed.file, "x, y, z, diameter", 3))
    return _measured(rows[:, :3], 0.5 * rows[:, 3], bed.file)


@spheres_of.register
def _(bed: MeasuredEllipsoids, base: Path) -> Spheres:
    path = base / bed.file
    names, rows = read_table(path, "give the name of a CSV file")
    lacking = next((name for name in _G3POINT if name not in names), None)
    if lacking is not None:
        raise SceneError(
            f"bed.file: {path} has no column {lacking}; write {', '.join(_G3POINT)} in the first row"
        )
    try:
        places = [names.index(name) for name in _G3POINT]
        table = np.array([[decimal(row[place]) for place in places] for row in rows]).reshape(-1, 6)
    except ValueError:
        raise SceneError(
            f"bed.file: {path} has a cell that is not a number; correct or remove that row"
        ) from None
    return _measured(table[:, :3], 0.5 * np.cbrt(table[:, 3:].prod(axis=1)), bed.file)


@spheres_of.register
def _(bed: LabelledHeights, base: Path) -> Spheres:
    heights = HeightMap.from_file(base / bed.heights, bed.cell).heights * bed.relief
    labels = _labels(base / bed.labels)
    if labels.shape != heights.shape:
        raise SceneError(
            f"bed.labels: {bed.labels} has {labels.shape} labels, {bed.heights} has {heights.shape} heights; "
            "give equal numbers of both"
        )
    names, pixels = np.unique(labels[labels > 0], return_counts=True)
    names, pixels = names[pixels >= FEWEST_PIXELS], pixels[pixels >= FEWEST_PIXELS]
    radii = np.sqrt(pixels * bed.cell[0] * bed.cell[1] / np.pi)
    rows = np.reshape(center_of_mass(np.ones_like(heights), labels, names), (-1, 2))
    places = rows[:, ::-1] * bed.cell + bed.offset
    centres = np.column_stack([places, maximum(heights, labels, names) - radii])
    return _measured(centres, radii, bed.labels)


def _labels(path: Path) -> np.ndarray:
    with reading(path, "give a PNG, TIFF or .npy file", LARGEST_FILE, name=f"bed.labels: {path}"):
        if path.suffix == ".npy":
            labels = array_in(path)
        else:
            with Image.open(path) as image:
                require_few(path, *image.size)
                labels = np.asarray(image)[::-1]  # the first row of an image is at the far side
    if labels.ndim != 2 or not np.issubdtype(labels.dtype, np.integer):
        raise SceneError(
            f"bed.labels: {path} is not a table of integers; give one for each height, 0 for no grain"
        )
    return labels


def _measured(centres: Floats, radii: Floats, name: str) -> Spheres:
    if len(radii) < 3 or not (
        np.isfinite(centres).all() and np.isfinite(radii).all() and (radii > 0.0).all()
    ):
        raise SceneError(
            f"bed: {name} has fewer than three grains with finite positions and positive diameters; correct it"
        )
    return Spheres(centres, radii)
