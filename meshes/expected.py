"""The expected number of cells of a region, from the target sizes."""

import numpy as np

from incipient.arrays import Floats, planar_cross

from .regions import Grid, Near, Region, Sizes, SolidRegion
from .size_map import BOX, SizeMap, boxes

PER_VOLUME = 5.4  # tetrahedra of side h in a volume of h^3
PER_AREA = 2.3  # triangles of side h on an area of h^2
PARTS = 50  # of a boundary along which sizes grow


def expected_cells(shape: Region | SolidRegion | Grid, sizes: Sizes) -> dict[str, float]:
    """Expected number of cells due to each part of the sizes, by name, without those of wall layers."""
    if isinstance(shape, Grid):
        return {"domain": float(shape.cells)}
    if isinstance(shape, SolidRegion):
        return _expected_tetrahedra(shape, sizes)
    left, right = shape.bottom[0].start, shape.bottom[-1].end
    height = shape.top - min(min(curve.start[1], curve.end[1]) for curve in shape.bottom)
    lengths = {
        shape.sides[0]: sum(curve.length for curve in shape.bottom),
        shape.sides[2]: right[0] - left[0],
        **{name: sum(curve.length for curve in outline) for name, outline in shape.inner.items()},
    }
    counts = {"domain": PER_AREA * (right[0] - left[0]) * height / sizes.far**2}
    # Points lie on boundaries, whose own sizes are smaller from some distance on.
    beside = min([2.0 * near.size for near in sizes.near if near.boundary], default=sizes.far)
    for near in sizes.near:
        name = near.boundary or "narrow places and corners"
        most = min(beside, sizes.far) if near.points else sizes.far
        counts[name] = counts.get(name, 0.0) + PER_AREA * _integral(near, most, height, lengths)
    # Four triangles about a curve that is shorter than the cells next to it
    counts["single curves"] = 4.0 * (len(shape.bottom) + sum(map(len, shape.inner.values())))
    if sizes.field is not None:
        counts["adaptation"] = PER_AREA * _integral_of_field(sizes)
    return counts


def _integral(near: Near, far: float, height: float, lengths: dict[str, float]) -> float:
    size = np.minimum(_along(near, lengths), far)
    reach = np.minimum((far - size) / near.growth, height)
    ratio = 1.0 + near.growth * reach / size
    if near.points:
        return float(
            len(near.points) * np.pi / near.growth**2 * (np.log(ratio) - 1.0 + 1.0 / ratio)[0]
        )
    return float(lengths[near.boundary] * np.mean((1.0 - 1.0 / ratio) / (near.growth * size)))


def _along(near: Near, lengths: dict[str, float]) -> Floats:
    if near.away is None or near.points:
        return np.array([near.size])
    distances = 0.5 * lengths[near.boundary] * (np.arange(PARTS) + 0.5) / PARTS
    return np.maximum(near.size, np.minimum(near.away.largest, near.away.growth * distances))


def _integral_of_field(sizes: Sizes) -> float:
    assert sizes.field is not None
    a, b, c = sizes.field.points[sizes.field.triangles].transpose(1, 0, 2)
    doubled = np.abs(planar_cross(b - a, c - a))
    return float(
        (0.5 * doubled * (sizes.field.sizes[sizes.field.triangles] ** -2.0).mean(axis=1)).sum()
    )


def _expected_tetrahedra(region: SolidRegion, sizes: Sizes) -> dict[str, float]:
    size = SizeMap.of(region, sizes)
    # With more boxes the estimate takes a minute.
    cubes = boxes(size, float(size.ground.draft().surface.points[:, 2].min()), 50_000)
    share = ~(size.outside(cubes.centres) | size.within(cubes.centres))
    count = PER_VOLUME * share * cubes.sides**3 * (cubes.sizes**-3.0).mean(axis=1)
    asking = np.argmin(size.parts(cubes.centres), axis=0)
    # Were the others cut on, to the smallest size of what asks for it, their number would grow as it did; but as many
    # are about a point at each distance.
    halvings = np.log2(cubes.sides / (BOX * size.least[asking])).clip(0.0)
    about_points = np.array([False, *(bool(near.points) for near in sizes.near), False, False])[
        asking
    ]
    grown = np.where(about_points, halvings, cubes.growth**halvings)
    count = np.where(cubes.uncut, np.maximum(count, PER_VOLUME * share * BOX**3 * grown), count)
    counts: dict[str, float] = {}
    for number, name in enumerate(size.names):
        counts[name] = counts.get(name, 0.0) + float(count[asking == number].sum())
    return counts
