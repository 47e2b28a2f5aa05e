"""The grains of a bed as spheres: deposited, or from files of measurements."""

from __future__ import annotations

from functools import singledispatch
from pathlib import Path

import numpy as np
from PIL import Image
from pydantic import ValidationError
from scipy.ndimage import center_of_mass, maximum

from ..arrays import Floats, decimal
from ..errors import SceneError
from ..geometry.space.heightmap import LARGEST_FILE, HeightMap, array_in, require_few
from ..input_files import read_table, reading
from ..scene.messages import one_line, problems_of
from ..scene.points import read_numbers
from .deposition import Spheres, deposited
from .request import MOST_GRAINS, Deposited, LabelledHeights, MeasuredEllipsoids, MeasuredSpheres

_G3POINT = ("Xc", "Yc", "Zc", "Dmax", "Dmed", "Dmin")
FEWEST_PIXELS = 12  # of a label that is a grain


@singledispatch
def spheres_of(bed: object, base: Path) -> Spheres:
    """The spheres of a section [bed], with files relative to `base`. Raises SceneError."""
    raise NotImplementedError(type(bed).__name__)


@spheres_of.register
def _(bed: Deposited, base: Path) -> Spheres:
    return deposited(_radii(bed), np.array([bed.length, bed.width]), bed.seed, bed.tries)


def _radii(bed: Deposited) -> Floats:
    random, count = np.random.default_rng([bed.seed, 1]), bed.number
    if bed.sizes == "uniform":
        return 0.5 * bed.diameter * random.uniform(1.0 - bed.spread, 1.0 + bed.spread, count)
    if bed.sizes == "lognormal":
        # Truncated at two standard deviations: a rare giant would be as large as the bed.
        drawn = np.clip(random.standard_normal(count), -2.0, 2.0)
        return np.asarray(0.5 * bed.diameter * (1.0 + bed.spread) ** drawn)
    return np.full(count, 0.5 * bed.diameter)


@spheres_of.register
def _(bed: MeasuredSpheres, base: Path) -> Spheres:
    columns = "x, y, z, diameter"
    try:
        rows = np.array(read_numbers(base / bed.file, 4, MOST_GRAINS, "bed", columns, 3))
    except ValidationError as error:
        raise SceneError(one_line("bed", problems_of(error, MeasuredSpheres))) from None
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
        table = np.array([[decimal(row[place]) for place in places] for row in rows])
    except ValueError:
        raise SceneError(
            f"bed.file: {path} has a cell that is not a number; correct or remove that row"
        ) from None
    table = table.reshape(-1, len(_G3POINT))
    return _measured(table[:, :3], 0.5 * np.cbrt(table[:, 3:].prod(axis=1)), bed.file)


@spheres_of.register
def _(bed: LabelledHeights, base: Path) -> Spheres:
    heights = HeightMap.from_file(base / bed.heights, bed.cell).heights * bed.relief
    labels = _labels(base / bed.labels)
    if labels.shape != heights.shape:
        why = f"has {labels.shape} labels, {bed.heights} has {heights.shape} heights"
        raise SceneError(f"bed.labels: {bed.labels} {why}; give equal numbers of both")
    names, pixels = np.unique(labels[labels > 0], return_counts=True)
    names, pixels = names[pixels >= FEWEST_PIXELS], pixels[pixels >= FEWEST_PIXELS]
    radii = np.sqrt(pixels * bed.cell[0] * bed.cell[1] / np.pi)
    middles = np.array(center_of_mass(np.ones_like(heights), labels, names)).reshape(-1, 2)
    places = middles[:, ::-1] * bed.cell + bed.offset
    centres = np.column_stack([places, maximum(heights, labels, names) - radii])
    return _measured(centres, radii, bed.labels)


def _labels(path: Path) -> np.ndarray:
    remedy = "give a PNG, TIFF or .npy file"
    with reading(path, remedy, LARGEST_FILE, name=f"bed.labels: {path}"):
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
