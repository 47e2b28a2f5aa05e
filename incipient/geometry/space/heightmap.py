"""Beds from height maps: rasters from an image or a table, with bicubic interpolation."""

from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.polynomial.polynomial import polyder
from numpy.typing import ArrayLike

from incipient.arrays import MOST_HEIGHTS, Floats, decimal, rows
from incipient.errors import SceneError
from incipient.geometry.shape import Extent, Sides
from incipient.geometry.space.beds import SmoothTerrain
from incipient.geometry.space.files import triangles_in
from incipient.input_files import reading

# Cubics through the two heights between which a point lies, by powers of its fraction of the cell, for each of the
# four heights around it (Keys 1981), and their first and second derivatives
KEYS = 0.5 * np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]])
CUBICS = np.array(
    [np.pad(polyder(KEYS, order, axis=1), ((0, 0), (0, order))) for order in range(3)]
)
ORDERS = np.arange(3)[:, None, None]
LARGEST_FILE = 64  # MiB
# Values that programs write for cells without data: ESRI's, those of 16-bit integers and of single precision
NO_DATA = (-9999.0, 9999.0, -32768.0, -32767.0, float(np.finfo(np.float32).min))


@dataclass(frozen=True, eq=False)
class HeightMap(SmoothTerrain):
    """Heights (rows, columns) at points `cell` apart, the first row lowest in y, the first point at `origin`.

    Bicubic (Keys 1981), with continuous normals; level beyond the outermost points.
    """

    heights: Floats
    cell: tuple[float, float]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        heights = np.array(self.heights, dtype=float)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise SceneError(
                "a height map needs two or more rows and columns; give a table of heights"
            )
        if gap := _gap(heights):
            raise SceneError(f"the height in row {gap[0]}, column {gap[1]} is not finite; fill it")
        heights.flags.writeable = False
        object.__setattr__(self, "heights", heights)

    @classmethod
    def from_file(cls, path: str | Path, cell: tuple[float, float] | None = None) -> "HeightMap":
        """A bed from a PNG or TIFF image, an array in a .npy file, or an ESRI ASCII grid (.asc).

        Whole numbers of images are divided by the largest of their type (black 0, white 1). The first row is that of
        largest y, of a .npy array that of least y. Raises SceneError for a file without finite heights.
        """
        path = Path(path)
        heights, own_cell, corner = _read(path)
        if cell is None and own_cell is None:
            raise SceneError(f"{path} does not say how far apart its heights are; give cell")
        _require_data(path, heights)
        return cls(heights, cell or own_cell or (0.0, 0.0), (*corner, 0.0))

    @classmethod
    def from_surface(
        cls, path: str | Path, cell: tuple[float, float] | None = None, scale: float = 1.0
    ) -> "HeightMap":
        """A bed from the upper side of a surface in an STL, PLY or OBJ file, times `scale`.

        The lowest height is zero; `cell` is by default a 200th of the longer side. Raises SceneError if the file
        cannot be read, or the surface has a hole as seen from above.
        """
        points, triangles = triangles_in(path)
        result = cls.of_triangles(scale * points[triangles], cell, Path(path))
        return replace(result, origin=(*result.origin[:2], 0.0))

    @classmethod
    def of_triangles(
        cls,
        corners: Floats,
        cell: tuple[float, float] | None,
        path: Path,
        within: Extent | None = None,
    ) -> "HeightMap":
        """A bed from the upper side of triangles (m, 3, 3) of a file; as `from_surface`.

        within: ((x, x), (y, y)) that matter; all by default
        """
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        if within is not None:
            least, most = np.transpose(within)
            low[:2], high[:2] = np.maximum(low[:2], least), np.minimum(high[:2], most)
        extent = high - low
        if not extent[:2].min() > 1e-9 * extent.max():
            raise SceneError(
                f"{path} has no upper side: it stands upright; turn it until z is upwards"
            )
        dx, dy = cell or 2 * (float(extent[:2].max()) / 200,)
        require_few(path, *(extent[:2] / (dx, dy)))
        along, across = (np.arange(low[k], high[k] + 1e-9 * d, d) for k, d in ((0, dx), (1, dy)))
        heights = _seen_from_above(corners, along, across, 1e-9 * float(extent[:2].max()))
        if gap := _gap(heights):
            raise SceneError(
                f"{path} has a hole as seen from above, at x = {along[gap[1]]:g}, y = {across[gap[0]]:g}; "
                "fill it, or cut the surface to a rectangle"
            )
        lowest = float(heights.min())
        return cls(heights - lowest, (dx, dy), (float(low[0]), float(low[1]), lowest))

    @property
    def origin_z(self) -> float:  # type: ignore[override]
        return self.origin[2]

    @property
    def feature(self) -> float:
        return 2.0 * min(self.cell)

    @property
    def crest(self) -> float:
        # Cubics may exceed heights by an eighth of their range in each direction.
        rise = float(np.ptp(self.heights))
        return float(self.origin[2] + self.heights.max() + 0.25 * rise)

    def crest_level(self, *sides: Sides) -> float:
        x, y = sides
        lines, columns = (
            self.origin[k] + self.cell[k] * np.arange(self.heights.shape[1 - k]) for k in (1, 0)
        )
        inside = (lines >= y[0]) & (lines <= y[1]), (columns >= x[0]) & (columns <= x[1])
        result = self.heights[np.ix_(*inside)]
        return float(self.origin[2] + (result if result.size else self.heights).max())

    @property
    def extent(self) -> Extent:
        rows_, columns = self.heights.shape
        (x, y, _), (dx, dy) = self.origin, self.cell
        return (x, x + dx * (columns - 1)), (y, y + dy * (rows_ - 1))

    def shape(self, x: ArrayLike) -> tuple[Floats, Floats, Floats]:
        at = (rows(x) - np.asarray(self.origin[:2])) / np.asarray(self.cell)
        count = np.array(self.heights.shape[::-1])
        # Beyond the edge everything is as at the edge.
        outside = (at < 0.0) | (at > count - 1)
        at = np.clip(at, 0.0, count - 1.0)
        low = np.minimum(at.astype(int), count - 2)
        powers = (at - low)[..., None] ** np.arange(4)
        weights = [
            (powers[:, k] @ (CUBICS / self.cell[k] ** ORDERS).reshape(-1, 4).T).reshape(-1, 3, 4)
            for k in (0, 1)
        ]
        i, j = (np.clip(low[:, k, None] + np.arange(-1, 3), 0, count[k] - 1) for k in (0, 1))
        values = self.heights[j[:, :, None], i[:, None, :]]
        table = weights[1] @ values @ weights[0].transpose(0, 2, 1)
        table[outside[:, 0], :, 1:] = 0.0
        table[outside[:, 1], 1:] = 0.0
        mixed = table[:, 1, 1]
        second = np.stack([table[:, 0, 2], mixed, mixed, table[:, 2, 0]], axis=1)
        first = np.column_stack([table[:, 0, 1], table[:, 1, 0]])
        return self.origin[2] + table[:, 0, 0], first, second.reshape(-1, 2, 2)


def _gap(heights: Floats) -> tuple[int, int] | None:
    gaps = np.argwhere(~np.isfinite(heights))
    return None if not len(gaps) else (int(gaps[0, 0]), int(gaps[0, 1]))


def _seen_from_above(corners: Floats, along: Floats, across: Floats, slack: float) -> Floats:
    heights = np.full((len(across), len(along)), -np.inf)
    low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
    left, right = np.searchsorted(along, low[:, 0]), np.searchsorted(along, high[:, 0])
    near, far = np.searchsorted(across, low[:, 1]), np.searchsorted(across, high[:, 1])
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    # Most triangles of a scan lie between the places, others are upright.
    for k in np.flatnonzero((left < right) & (near < far) & (np.abs(areas) > slack**2)):
        columns, lines = slice(left[k], right[k]), slice(near[k], far[k])
        item, a, b, area = corners[k], first[k], second[k], areas[k]
        x, y = np.meshgrid(along[columns] - item[0, 0], across[lines] - item[0, 1])
        s, t = (x * b[1] - y * b[0]) / area, (y * a[0] - x * a[1]) / area
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
        here = np.where(inside, item[0, 2] + s * a[2] + t * b[2], -np.inf)
        heights[lines, columns] = np.maximum(heights[lines, columns], here)
    return heights


Raster = tuple[
    Floats, tuple[float, float] | None, tuple[float, float]
]  # heights, cell, first point


def _read(path: Path) -> Raster:
    kind = path.suffix.lower()
    images = dict.fromkeys((".png", ".tif", ".tiff"), _read_image)
    readers = {".npy": _read_array, ".asc": _read_grid, **images}
    remedy = "give the name of a PNG, TIFF, .npy or .asc file, or export it again"
    with reading(path, remedy, LARGEST_FILE, name=str(path)):
        if kind not in readers:
            raise SceneError(f"{path} is not a PNG, TIFF, .npy or .asc file; convert it")
        return readers[kind](path)


def _require_data(path: Path, heights: Floats) -> None:
    lacking = np.isin(heights, NO_DATA)
    others = heights[~lacking]
    if not lacking.any() or not others.size:
        return
    value, (row, column) = heights[lacking][0], np.argwhere(lacking)[0]
    if np.abs(others - value).min() > np.ptp(others):
        raise SceneError(
            f"{path} is {value:g} in {lacking.sum()} of its cells, the first in row {row}, column {column}"
            ": that seems to stand for no data; fill such cells"
        )


def _read_array(path: Path) -> Raster:
    return array_in(path).astype(float), None, (0.0, 0.0)


def array_in(path: Path) -> np.ndarray:
    """The numbers in a .npy file, mapped into memory. Raises SceneError."""
    result = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(result, np.ndarray):
        raise SceneError(f"{path} is an archive of arrays; save one array with numpy.save")
    if result.dtype.kind not in "fiub":
        raise SceneError(f"{path} holds values of type {result.dtype.name}; save real numbers")
    require_few(path, *result.shape)
    return result


def require_few(path: Path, *counts: float) -> None:
    """Refuse a raster of too many heights before it is read or made."""
    count = float(np.prod(np.array(counts, dtype=float)))
    if count > MOST_HEIGHTS:
        raise SceneError(
            f"{path} has {count:.7g} heights; give {MOST_HEIGHTS} at most, or a larger cell"
        )


def _read_image(path: Path) -> Raster:
    from PIL import Image

    with Image.open(path) as opened:
        image: Image.Image = opened
        require_few(path, *image.size)
        if image.mode in ("P", "1", "LA", "RGBA", "CMYK"):
            image = image.convert("L" if image.mode in ("1", "LA") else "RGB")
        values = np.asarray(image)
    # 16-bit greys are delivered as 32-bit integers by some versions of the reader.
    whole = values.dtype.kind in "ui"
    largest = (255 if values.dtype.itemsize == 1 else 65535) if whole else 1
    heights = values.astype(float) / largest
    return (heights.mean(axis=2) if heights.ndim == 3 else heights)[::-1], None, (0.0, 0.0)


def _read_grid(path: Path) -> Raster:
    """An ESRI ASCII grid, whose rows begin in the north."""
    lines = path.read_text(encoding="ascii").splitlines()
    head = list(takewhile(lambda line: line.lstrip()[:1].isalpha(), lines))
    header = {word.lower(): decimal(number) for word, number in map(str.split, head)}
    missing = [word for word in ("ncols", "nrows", "cellsize") if word not in header]
    if missing:
        raise SceneError(f"{path} lacks {missing[0]} in its header; write an ESRI ASCII grid")
    counts = header["nrows"], header["ncols"]
    require_few(path, *counts)
    values = np.array([decimal(item) for item in " ".join(lines[len(head) :]).split()])
    if values.size != counts[0] * counts[1]:
        raise SceneError(
            f"{path} has {values.size} heights instead of {counts[0]:g} x {counts[1]:g}; "
            "check its header"
        )
    if (values == header.get("nodata_value", np.nan)).any():
        raise SceneError(f"{path} has cells without data; fill them")
    cell = header["cellsize"]
    corner = [
        header.get(f"{a}llcenter", header.get(f"{a}llcorner", -0.5 * cell) + 0.5 * cell)
        for a in "xy"
    ]
    return values.reshape(int(counts[0]), -1)[::-1], (cell, cell), (corner[0], corner[1])
