"""The section [bed]: beds in 2-D and 3-D."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from .. import geometry
from ..arrays import MOST_HEIGHTS
from .grains import Ball
from .section import (
    MOST_POINTS,
    FromFile,
    NotNegative,
    Pair,
    Positive,
    PositivePair,
    Rule,
    Section,
    file_key,
    key,
)

MOST_SPHERES = 10_000  # of a heap

APART = Rule("spacing", lambda s: s.spacing < 2.0 * s.radius and 2.0 * s.radius,
             "{s.spacing:g} is less than two radii, {v:g}: the {s.kind} overlap",
             "enlarge spacing or reduce radius")  # fmt: skip


class BedSection(Section):
    """Common keys of beds.

    A kind has `shape(base, corner)`: its geometry above a base line or plane at this height, with x, in 3-D also y,
    counted from a corner.
    """

    gdim: ClassVar[int | None] = 2  # the scene's; None: any

    @property
    def slope_angle(self) -> float:
        return math.radians(getattr(self, "slope", 0.0))


class Flat(BedSection):
    """A horizontal plane."""

    gdim: ClassVar[int | None] = None
    kind: Literal["flat"] = key("Kind of bed", "flat")

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        return geometry.Flat(base) if len(corner) == 1 else geometry.Plane(origin_z=base)


class Inclined(Flat):
    """A plane that falls in the direction of the flow; coordinates are parallel to it and gravity is turned."""

    kind: Literal["inclined"] = key("Kind of bed", "inclined")  # type: ignore[assignment]
    slope: float = key(
        "Angle by which the bed falls in the direction of the flow [degrees]", gt=-90, lt=90
    )


class Sinusoidal(BedSection):
    """Ripples, amplitude sin(2 pi x / wavelength + phase) above the base line."""

    kind: Literal["sinusoidal"] = key("Kind of bed", "sinusoidal")
    amplitude: NotNegative = key("Half the height from trough to crest [length]")
    wavelength: Positive = key("Distance between crests [length]")
    phase: float = key("Phase at x = 0 [degrees]", 0.0)

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        ahead = math.radians(self.phase) + math.tau * math.fmod(corner[0] / self.wavelength, 1.0)
        return geometry.Sinusoidal(self.amplitude, self.wavelength, ahead, base)


class HalfDiscs(BedSection):
    """A row of half-discs on the base line."""

    rules = (APART,)
    kind: Literal["half-discs"] = key("Kind of bed", "half-discs")
    radius: Positive = key("Radius of the half-discs [length]")
    spacing: Positive = key("Distance between their centres, at least two radii [length]")
    offset: float = key("Abscissa of the centre of one of them [length]", 0.0)

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        return geometry.HalfDiscs(self.radius, self.spacing, self.offset - corner[0], base)


def _disorder(s: Any) -> list[tuple[float, float]]:
    pairs = pairwise(s.points)
    return [(right[0], left[0]) for left, right in pairs if right[0] < left[0] or right == left][:1]


class Polyline(FromFile, BedSection):
    """Straight lines, or a smooth curve, through points."""

    rules = (
        Rule("points", _disorder, "has x = {v[0]:g} after x = {v[1]:g}",
             "sort the points by ascending x, each place once"),
        Rule("smooth", lambda s: s.smooth and s.steps,
             "is true, but points have a step, the same x twice", "leave it out"),
    )  # fmt: skip
    kind: Literal["polyline"] = key("Kind of bed", "polyline")
    file: str | None = file_key("CSV file of x, y,", "points", "bed.csv")
    points: Annotated[
        tuple[Pair, ...], Field(strict=False, min_length=2, max_length=MOST_POINTS)
    ] = key(
        "Points with ascending x, heights counted from the base line; the same x twice: a step [length]",
        (),
    )
    smooth: bool = key("A smooth curve through the points instead of straight lines", False)

    @property
    def steps(self) -> list[float]:
        """Abscissae that are given twice."""
        return [left[0] for left, right in pairwise(self.points) if left[0] == right[0]]

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        curve = geometry.Curved if self.smooth else geometry.Polyline
        return curve([(x - corner[0], y) for x, y in self.points], base)


PlaneBed = Flat | Inclined | Sinusoidal | HalfDiscs | Polyline


# -- 3-D -------------------------------------------------------------------------------------------


class TerrainSection(BedSection):
    """Common keys of beds in 3-D only."""

    gdim: ClassVar[int | None] = 3
    shape_key: ClassVar[str] = "kind"  # the key that is refused if the bed is not possible

    slope: float = key(
        "Angle by which the bed falls in the direction of the flow [degrees]", 0.0, gt=-90, lt=90
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("{s.shape_key}", lambda s: s.shape(0.0, (0.0, 0.0)) is None),  # which its geometry may refuse
    )  # fmt: skip


class SphereBed(TerrainSection):
    """Equal spheres, the lowest half below the base plane."""

    shape_key = "layers"
    rules = (
        APART,
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

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        offset = self.offset[0] - corner[0], self.offset[1] - corner[1]
        rows = base, math.radians(self.angle), self.layers, self.seed
        return geometry.SphereBed.array(self.radius, self.spacing, self.arrangement, offset, *rows)


class HeapBed(FromFile, TerrainSection):
    """Spheres of any sizes at given positions above the base plane."""

    in_file = shape_key = "spheres"
    instead = "give the name of a CSV file"
    columns, fewest = "x, y, z, radius", 1
    kind: Literal["heap"] = key("Kind of bed", "heap")
    file: str | None = file_key("CSV file of x, y, z, radius,", "spheres", "bed.csv")
    spheres: Annotated[tuple[Ball, ...], Field(strict=False, max_length=MOST_SPHERES)] = key(
        "x, y, z above the base plane, and radius of each sphere [length]", ()
    )
    posts: Annotated[tuple[Ball, ...], Field(strict=False)] = key(
        "The same of spheres extended to the base plane by cylinders [length]", ()
    )

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        spheres = np.array(self.spheres + self.posts, dtype=float).reshape(-1, 4)
        posts = np.arange(len(spheres)) >= len(self.spheres)
        return geometry.SphereBed(
            spheres[:, :3] + [-corner[0], -corner[1], base], spheres[:, 3], base, posts
        )


class RidgeBed(TerrainSection):
    """Ripples, amplitude sin(2 pi (x cos(angle) + y sin(angle)) / wavelength + phase) above the base plane."""

    kind: Literal["ridges"] = key("Kind of bed", "ridges")
    amplitude: NotNegative = key("Half the height from trough to crest [length]")
    wavelength: Positive = key("Distance between crests [length]")
    angle: float = key("Direction across the crests, from x towards y [degrees]", 0.0)
    phase: float = key("Phase at x = y = 0 [degrees]", 0.0)

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        angle = math.radians(self.angle)
        ahead = corner[0] * math.cos(angle) + corner[1] * math.sin(angle)
        phase = math.radians(self.phase) + math.tau * math.fmod(ahead / self.wavelength, 1.0)
        return geometry.Ridges(self.amplitude, self.wavelength, angle, phase, base)


class RasterBed(FromFile, TerrainSection):
    """Heights on a raster."""

    in_file = shape_key = "heights"
    rules = (
        Rule("heights", lambda s: (number := sum(map(len, s.heights))) > MOST_HEIGHTS and number,
             "are {v}", f"give {MOST_HEIGHTS} at most, or a larger cell"),
        Rule("heights", lambda s: len(set(map(len, s.heights))) > 1,
             "are in rows of different lengths", "give as many in each"),
        Rule("cell", lambda s: s.heights and s.cell is None, "is missing",
             "give the spacing of the heights, as in [0.1, 0.1]"),
    )  # fmt: skip

    heights: Annotated[
        tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False)
    ] = key("Heights above the base plane, rows of ascending y [length]", ())

    cell: PositivePair | None = key(
        "Spacing of the heights in x and y; default: that of an .asc file, of a surface 200 along its longer side "
        "[length]",
        None,
        examples=[(0.1, 0.1)],
    )
    offset: Pair = key(
        "x, y of the first height, of a surface those of its origin; default: that of an .asc file [length]",
        (0.0, 0.0),
    )

    @classmethod
    def raster(cls, path: Path, cell: Any, given: Any) -> tuple[geometry.HeightMap, Any]:
        """The heights of a file, sampled with `cell` if not None, and x, y of the first one; `given`: other keys."""
        raise NotImplementedError

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        cell = data.get("cell")
        # The other keys are validated with a raster of any heights and, if its size is in the file, any size.
        others = {"cell": (1.0, 1.0) if cell is None else cell, "heights": ((0.0, 0.0), (0.0, 0.0))}
        given = cls.model_validate(data | others)
        raster, offset = cls.raster(path, None if cell is None else given.cell, given)
        return {"cell": raster.cell, "offset": tuple(offset), "heights": raster.heights.tolist()}

    def shape(self, base: float, corner: Sequence[float]) -> Any:
        assert self.cell is not None
        place = (self.offset[0] - corner[0], self.offset[1] - corner[1], base)
        return geometry.HeightMap(
            getattr(self, "relief", 1.0) * np.array(self.heights), self.cell, place
        )


class HeightMapBed(RasterBed):
    """Heights on a raster, from an image or a table."""

    instead = "give the name of a PNG, TIFF, .npy or .asc file"
    kind: Literal["height-map"] = key("Kind of bed", "height-map")
    file: str | None = file_key("PNG, TIFF, .npy or .asc file,", "heights", "bed.png")
    relief: float = key("Factor on the heights; of images: from black to white [length]", 1.0)

    @classmethod
    def raster(cls, path: Path, cell: Any, given: Any) -> tuple[geometry.HeightMap, Any]:
        raster = geometry.HeightMap.from_file(path, cell)
        return raster, given.offset if "offset" in given.model_fields_set else raster.origin[:2]


class MeshBed(RasterBed):
    """Upper side of a triangulated surface, such as a scanned bed, from an STL, PLY or OBJ file."""

    instead = "give the name of an STL, PLY or OBJ file"
    kind: Literal["mesh"] = key("Kind of bed", "mesh")
    file: str | None = file_key("STL, PLY or OBJ file,", "heights", "bed.stl")
    scale: Positive = key("Factor on the file's coordinates [length]", 1.0)

    @classmethod
    def raster(cls, path: Path, cell: Any, given: Any) -> tuple[geometry.HeightMap, Any]:
        raster = geometry.HeightMap.from_surface(path, cell, given.scale)
        return raster, np.add(given.offset, raster.origin[:2]).tolist()


TerrainBed = SphereBed | HeapBed | RidgeBed | HeightMapBed | MeshBed
