"""Beds in 3-D: their sections and geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from .. import geometry
from ..arrays import LARGEST, MOST_HEIGHTS, SMALLEST
from ..errors import SceneError
from .messages import Problem, refusal, shown, split
from .points import FromFile, about_file, file_key, read_numbers
from .section import NotNegative, Pair, Positive, PositivePair, Rule, key
from .shapes import BedSection, apart
from .solids import Ball

MOST_SPHERES = 10_000  # of a heap


class TerrainSection(BedSection):
    """Common keys of beds in 3-D only."""

    gdims: ClassVar[tuple[int, ...]] = (3,)
    shape_key: ClassVar[str] = "kind"  # the key that is refused if the bed is not possible

    slope: float = key(
        "Angle by which the bed falls in the direction of the flow [degrees]", 0.0, gt=-90, lt=90
    )

    @model_validator(mode="after")
    def _has_a_shape(self) -> Self:
        self.require(self.shape_key, lambda: self.terrain(0.0))
        return self


class SphereBed(TerrainSection):
    """Equal spheres, the lowest half below the base plane."""

    shape_key = "layers"
    rules = (
        apart("spheres"),
        Rule("seed", lambda s: s.seed and s.arrangement != "random",
             "is read only for a random arrangement", "leave it out"),
    )  # fmt: skip
    kind: Literal["spheres"] = key("Kind of bed", "spheres")
    radius: Positive = key("Radius of the spheres [length]")
    spacing: Positive = key("Distance between neighbours' centres, at least two radii [length]")
    arrangement: Literal["square", "triangular", "random"] = key(
        "Aligned rows, rows shifted by half a spacing, or these in disorder", "triangular"
    )
    layers: int = key("Layers, each in the pockets of that below it", 1, ge=1, le=100)
    seed: int = key("Seed of the disorder", 0, ge=0, le=2**31)
    offset: Pair = key("x, y of the centre of one sphere [length]", (0.0, 0.0))
    angle: float = key("Angle of the rows, from x towards y [degrees]", 0.0)

    def terrain(self, origin_z: float, corner: Sequence[float] = (0.0, 0.0)) -> geometry.Terrain:
        offset = self.offset[0] - corner[0], self.offset[1] - corner[1]
        angle = math.radians(self.angle)
        kind = self.arrangement
        return geometry.SphereBed.array(
            self.radius, self.spacing, kind, offset, origin_z, angle, self.layers, self.seed
        )


class HeapBed(FromFile, TerrainSection):
    """Spheres of any sizes at given positions above the base plane."""

    in_file = shape_key = "spheres"
    instead = "give the name of a CSV file"
    kind: Literal["heap"] = key("Kind of bed", "heap")
    file: str | None = file_key("CSV file of x, y, z, radius,", "spheres", "bed.csv")
    spheres: Annotated[tuple[Ball, ...], Field(strict=False, max_length=MOST_SPHERES)] = key(
        "x, y, z above the base plane, and radius of each sphere [length]", ()
    )
    posts: Annotated[tuple[Ball, ...], Field(strict=False)] = key(
        "The same of spheres extended to the base plane by cylinders [length]", ()
    )

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        return {"spheres": read_numbers(path, 4, MOST_SPHERES, "HeapBed", "x, y, z, radius")}

    def terrain(self, origin_z: float, corner: Sequence[float] = (0.0, 0.0)) -> geometry.Terrain:
        spheres = np.array(self.spheres + self.posts, dtype=float).reshape(-1, 4)
        posts = np.arange(len(spheres)) >= len(self.spheres)
        return geometry.SphereBed(
            spheres[:, :3] + [-corner[0], -corner[1], origin_z], spheres[:, 3], origin_z, posts
        )


class RidgeBed(TerrainSection):
    """Ripples, amplitude sin(2 pi (x cos(angle) + y sin(angle)) / wavelength + phase) above the base plane."""

    kind: Literal["ridges"] = key("Kind of bed", "ridges")
    amplitude: NotNegative = key("Half the height from trough to crest [length]")
    wavelength: Positive = key("Distance between crests [length]")
    angle: float = key("Direction across the crests, from x towards y [degrees]", 0.0)
    phase: float = key("Phase at x = y = 0 [degrees]", 0.0)

    def terrain(self, origin_z: float, corner: Sequence[float] = (0.0, 0.0)) -> geometry.Terrain:
        angle = math.radians(self.angle)
        ahead = corner[0] * math.cos(angle) + corner[1] * math.sin(angle)
        phase = (
            math.radians(self.phase)
            + 2.0 * math.pi * math.fmod(ahead, self.wavelength) / self.wavelength
        )
        return geometry.Ridges(self.amplitude, self.wavelength, angle, phase, origin_z)


class RasterBed(FromFile, TerrainSection):
    """Heights on a raster."""

    in_file = shape_key = "heights"
    rules = (
        Rule("heights", lambda s: sum(map(len, s.heights)) > MOST_HEIGHTS,
             lambda s: f"are {sum(map(len, s.heights))}", f"give {MOST_HEIGHTS} at most, or a larger cell"),
        Rule("heights", lambda s: len(set(map(len, s.heights))) > 1,
             "are in rows of different lengths", "give as many in each"),
        Rule("cell", lambda s: s.cell is None, "is missing",
             "give the spacing of the heights, as in [0.1, 0.1]"),
    )  # fmt: skip

    heights: Annotated[
        tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False)
    ] = key("Heights above the base plane, rows of ascending y [length]", ())

    if TYPE_CHECKING:
        cell: tuple[float, float] | None
        offset: tuple[float, float]

    @classmethod
    def _in_file(cls, path: Path, cell: Any, data: dict[str, Any]) -> geometry.HeightMap:
        raise NotImplementedError

    @classmethod
    def _first_at(cls, offset: Any, origin: Sequence[float]) -> tuple[float, float]:
        raise NotImplementedError

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        for name in ("cell", "offset", "scale"):
            _require_numbers(cls.__name__, name, data.get(name))
        try:
            cell = data.get("cell")
            raster = cls._in_file(path, None if cell is None else tuple(cell), data)
        except SceneError as error:
            raise about_file(cls.__name__, *split(str(error))) from None
        offset = cls._first_at(data.get("offset"), raster.origin)
        return {"cell": raster.cell, "offset": offset, "heights": raster.heights.tolist()}

    def terrain(self, origin_z: float, corner: Sequence[float] = (0.0, 0.0)) -> geometry.Terrain:
        assert self.cell is not None
        place = (self.offset[0] - corner[0], self.offset[1] - corner[1], origin_z)
        return geometry.HeightMap(
            getattr(self, "relief", 1.0) * np.array(self.heights), self.cell, place
        )


class HeightMapBed(RasterBed):
    """Heights on a raster, from an image or a table."""

    instead = "give the name of a PNG, TIFF, .npy or .asc file"
    kind: Literal["height-map"] = key("Kind of bed", "height-map")
    file: str | None = file_key("PNG, TIFF, .npy or .asc file,", "heights", "bed.png")
    cell: PositivePair | None = key(
        "Spacing of the heights in x and y; .asc files have it [length]",
        None,
        examples=[(0.1, 0.1)],
    )
    relief: float = key("Factor on the heights; of images: from black to white [length]", 1.0)
    offset: Pair = key(
        "x, y of the first height; default: that of an .asc file [length]", (0.0, 0.0)
    )

    @classmethod
    def _first_at(cls, offset: Any, origin: Sequence[float]) -> tuple[float, float]:
        x, y = origin[:2] if offset is None else offset
        return x, y

    @classmethod
    def _in_file(cls, path: Path, cell: Any, data: dict[str, Any]) -> geometry.HeightMap:
        return geometry.HeightMap.from_file(path, cell)


class MeshBed(RasterBed):
    """Upper side of a triangulated surface, such as a scanned bed, from an STL, PLY or OBJ file."""

    instead = "give the name of an STL, PLY or OBJ file"
    kind: Literal["mesh"] = key("Kind of bed", "mesh")
    file: str | None = file_key("STL, PLY or OBJ file,", "heights", "bed.stl")
    cell: PositivePair | None = key(
        "Spacing of the sampled heights; default: 200 along the longer side [length]",
        None,
        examples=[(0.1, 0.1)],
    )
    scale: Positive = key("Factor on the file's coordinates [length]", 1.0)
    offset: Pair = key("x, y of the file's origin [length]", (0.0, 0.0))

    @classmethod
    def _first_at(cls, offset: Any, origin: Sequence[float]) -> tuple[float, float]:
        x, y = (0.0, 0.0) if offset is None else offset
        return x + origin[0], y + origin[1]

    @classmethod
    def _in_file(cls, path: Path, cell: Any, data: dict[str, Any]) -> geometry.HeightMap:
        return geometry.HeightMap.from_surface(path, cell, data.get("scale", 1.0))


_NUMBERS = {  # keys with which a file is read: number of values, lower bound, remedy
    "cell": (2, SMALLEST, "give two lengths, as in [0.1, 0.1]"),
    "offset": (2, -LARGEST, "give two lengths, as in [0.1, 0.1]"),
    "scale": (1, SMALLEST, "give a positive number"),
}


def _require_numbers(section: str, key: str, value: Any) -> None:
    count, least, remedy = _NUMBERS[key]
    numbers = value if count > 1 and isinstance(value, (list, tuple)) else [value]
    if value is None or (
        len(numbers) == count
        and all(
            isinstance(number, (int, float)) and least <= number <= LARGEST for number in numbers
        )
    ):
        return
    raise refusal(section, [Problem((key,), f"is {shown(value)}", remedy)])


TerrainBed = SphereBed | HeapBed | RidgeBed | HeightMapBed | MeshBed
