"""3-D regions meshed with tetrahedra, curved along grains and bed, with layers along walls."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.errors import MeshError
from incipient.geometry.space.remeshing import remeshed, without_area
from incipient.geometry.triangles import (
    Surface,
    connected,
    crossed,
    joined,
)

from .layers import ON_PLANE, Columns, with_layers
from .regions import Sizes, SolidRegion
from .session import generate, gmsh, set_background, view_field
from .simplices import EDGES, Simplices
from .size_map import SizeMap, boxes

log = logging.getLogger("incipient")

ATTEMPTS = 4  # at surfaces that do not cross, each finer where they did
# Of the wall's bend: that where layers end. In 18 meshes of a sphere, an ellipsoid and a rounded box 74 edges did not
# follow the wall with 0.6, 145 with 0.5, 88 with 0.7, 202 with one, 746 with none; each meshed once, as in
# `test_layers_follow_a_curved_grain`.
AT_TOP = 0.6


def meshed_solid_region(region: SolidRegion, sizes: Sizes, order: int) -> Simplices:
    """The mesh of a region, with tetrahedra of order 1 or 2, made in the current gmsh model.

    Raises MeshError if a surface is open or surfaces cross, layers do not fit, or gmsh fails.
    """
    if order not in (1, 2):
        raise MeshError(
            f"3-D cells are of order 1 or 2, not {order}: change numerics.geometry_order"
        )
    size = SizeMap.of(region, sizes)
    straight = np.empty((0, 3))
    for _ in range(ATTEMPTS):
        if len(straight):
            gmsh.clear()
            size = size.finer_at(straight)
        size, mesh, straight = _meshed(size, order)
        if not len(straight):
            break
    else:
        near = np.round(size.frame.scene(straight[0]), 6).tolist()
        log.warning(
            "%d edges of cells do not follow a curved grain, one near %s, since cells would fold over: "
            "use a smaller numerics.mesh_size",
            *(len(straight), near),
        )
    return replace(mesh, points=size.frame.scene(mesh.points))


def _meshed(size: SizeMap, order: int) -> tuple[SizeMap, Simplices, Floats]:
    size, surfaces = triangulated(size)
    bed = surfaces[size.region.names[5]]
    cubes = boxes(size, float(bed.points[:, 2].min()))
    corners = cubes.corners.transpose(0, 2, 1).reshape(-1, 24)
    set_background(view_field("SH", np.concatenate([corners, cubes.sizes], axis=1)))
    mesh, columns = _filled(*_closed_shell(size, surfaces)), None
    if size.sizes.layers is not None:
        layers = size.sizes.layers.scaled(1.0 / size.frame.length)
        mesh, columns = with_layers(mesh, layers)
    mesh, straight = _on_surfaces(mesh.of_order(order), size, columns)
    return size, mesh, mesh.points[straight]


def triangulated(size: SizeMap) -> tuple[SizeMap, dict[str, Surface]]:
    """Bed and grains by name as triangles of the target sizes, and these, finer where surfaces would cross.

    Raises MeshError if a grain penetrates the bed, or surfaces cross at any resolution.
    """
    bed_name, names = size.region.names[5], list(size.surfaces)
    crossing: list[str] = []
    for attempt in range(ATTEMPTS):
        surfaces = {name: remeshed(exact, size) for name, exact in size.surfaces.items()}
        for name in size.bodies:
            points = surfaces[name].points
            if inside := int((size.ground.distance(points) <= 0.0).sum()):
                raise MeshError(
                    f'"{name}" reaches into the bed with {inside} of {len(points)} points: lift it'
                )
        whole = joined(list(surfaces.values()))
        wrong = np.union1d(crossed(whole), without_area(whole))
        if not len(wrong):
            return size, surfaces
        ends = np.cumsum([len(surface.triangles) for surface in surfaces.values()])
        crossing = [names[k] for k in np.unique(np.searchsorted(ends, wrong, side="right"))]
        # Balls that cross themselves may have been folded by their first triangles: others come before finer ones.
        folded = crossing == [bed_name] and size.ground.of_balls
        if folded:
            ground = replace(size.ground, finer=1.07 ** (attempt + 1))
            size = replace(size, ground=ground)
        if attempt or not folded:
            size = size.finer_at(whole.corners[wrong].mean(axis=1))
    surface, remedy = (
        f"surface of {' and that of '.join(crossing)} cross",
        "use a smaller numerics.mesh_size, or a wider contact.gap",
    )
    if len(crossing) == 1:  # cells made half as large again and again have not helped
        surface += "es itself"
        remedy = f"make {crossing[0]} thicker or blunter there, or round its edges"
    near = np.round(size.frame.scene(size.spots[-1:])[0], 6).tolist()
    raise MeshError(f"the {surface} in {len(wrong)} triangles near {near}: {remedy}")


def _closed_shell(
    size: SizeMap, surfaces: dict[str, Surface]
) -> tuple[Floats, dict[str, Integers]]:
    """Points (n, 3) of the whole boundary and, by name, triangles (m, 3). Draws in the current gmsh model."""
    names = size.region.names
    plates = _plane_sides(size, surfaces)
    tables = [surface.corners for surface in surfaces.values()] + plates
    points = np.concatenate([table.reshape(-1, 3) for table in tables])
    # Points as near each other, in heights of the region, are one.
    _, first, number = np.unique(
        np.round(points / 1e-10), axis=0, return_index=True, return_inverse=True
    )
    triangles: dict[str, list[Integers]] = {}
    starts = np.cumsum([3 * len(table) for table in tables])[:-1]
    for name, part in zip([*surfaces, *names[:5]], np.split(number.ravel(), starts), strict=True):
        triangles.setdefault(name, []).append(part.reshape(-1, 3))
    return points[first], {name: np.concatenate(parts) for name, parts in triangles.items()}


def _plane_sides(size: SizeMap, surfaces: dict[str, Surface]) -> list[Floats]:
    geo, (low, high) = gmsh.model.geo, size.bounds
    planes = [(axis, end[axis]) for axis in (0, 1) for end in (low, high)] + [(2, 1.0)]
    segments = []
    for surface in surfaces.values():
        rim = surface.points[surface.topology.edges[surface.topology.open]]
        segments += [rim[_within(rim, plane)] for plane in planes[:4]]
    rims = np.concatenate(segments)
    bed = surfaces[size.region.names[5]].points
    bottom = []
    for corner in ([low[0], low[1]], [high[0], low[1]], high, [low[0], high[1]]):
        at = np.flatnonzero((bed[:, :2] == corner).all(axis=1))
        if len(at) != 1:
            raise MeshError("the bed does not reach into a corner of the domain")
        bottom.append(bed[at[0]])
    top = np.column_stack([np.array(bottom)[:, :2], np.ones(4)])
    upright, upper = (
        np.stack([bottom, top], axis=1),
        np.stack([top, np.roll(top, -1, axis=0)], axis=1),
    )
    lines = np.concatenate([rims, upright, upper])
    _, first, number = np.unique(
        lines.reshape(-1, 3), axis=0, return_index=True, return_inverse=True
    )
    ends = number.reshape(-1, 2)
    points = {
        int(number.ravel()[k]): geo.addPoint(*lines.reshape(-1, 3)[k]) for k in np.sort(first)
    }
    tags = np.array([geo.addLine(*sorted((points[a], points[b]))) for a, b in ends.tolist()])
    for tag in tags[: len(rims)]:
        geo.mesh.setTransfiniteCurve(tag, 2)
    plates: dict[str, list[int]] = {}
    for axis, end in planes:
        chosen = np.flatnonzero(_within(lines, (axis, end)))
        label = connected(len(points), ends[chosen])[ends[chosen, 0]]
        rings = [chosen[label == loop] for loop in np.unique(label)]
        loops = [geo.addCurveLoop(tags[ring], reorient=True) for ring in rings]
        flat = np.delete(lines, axis, axis=2)
        encloses = np.array([[_encloses(flat[a], flat[b][0, 0]) for b in rings] for a in rings])
        np.fill_diagonal(encloses, False)
        depth = encloses.sum(axis=0)
        # Fluid lies within every second ring: also in the hole of a grain that is cut through it.
        plates[f"{axis}, {end}"] = [
            geo.addPlaneSurface(
                [
                    loops[k],
                    *(loops[n] for n in np.flatnonzero(encloses[k] & (depth == depth[k] + 1))),
                ]
            )
            for k in np.flatnonzero(depth % 2 == 0)
        ]
    geo.synchronize()
    gmsh.model.mesh.generate(2)
    mesh = Simplices.read(plates, 3)
    if not all(map(len, mesh.sides.values())):
        raise MeshError("the geometry could not be meshed: a side of the domain has no triangles")
    gmsh.model.mesh.clear()
    gmsh.model.removeEntities(gmsh.model.getEntities(), recursive=True)
    return [mesh.points[part] for part in mesh.sides.values()]


def _within(lines: Floats, plane: tuple[int, float]) -> np.ndarray:
    return np.asarray((lines[:, :, plane[0]] == plane[1]).all(axis=1))


def _encloses(ring: Floats, point: Floats) -> bool:
    """Whether a closed line of segments (n, 2, 2), in any order, goes around a point (2,) that is not on it."""
    (x, y), (u, v) = ring[:, 0].T, ring[:, 1].T
    passes = (y > point[1]) != (v > point[1])
    at = x[passes] + (u - x)[passes] * (point[1] - y[passes]) / (v - y)[passes]
    return bool((at > point[0]).sum() % 2)


def _filled(points: Floats, triangles: dict[str, Integers]) -> Simplices:
    model, tags = gmsh.model, dict[str, list[int]]()
    for number, name in enumerate(triangles, start=1):
        tags[name] = [model.addDiscreteEntity(2, number)]
    numbers = np.arange(1, len(points) + 1)
    model.mesh.addNodes(2, 1, numbers.tolist(), points.ravel().tolist())
    for name, part in triangles.items():
        model.mesh.addElementsByType(tags[name][0], 2, [], (part + 1).ravel().tolist())
    model.mesh.reclassifyNodes()
    model.geo.addVolume([model.geo.addSurfaceLoop([tag for (tag,) in tags.values()])])
    model.geo.synchronize()
    generate(3)
    return Simplices.read(tags, 3).used()


def _on_surfaces(
    mesh: Simplices, size: SizeMap, columns: Columns | None
) -> tuple[Simplices, Integers]:
    """The cells with their points on the exact surfaces, and the edges whose middles are not: cells would fold."""
    low, high = size.bounds

    def held(x: Floats) -> np.ndarray:
        on_side = [np.abs(x[:, :2] - end) <= ON_PLANE for end in (low, high)]
        return np.column_stack([on_side[0] | on_side[1], np.abs(x[:, 2] - 1.0) <= ON_PLANE])

    points, none = mesh.points.copy(), np.empty(0, dtype=np.int64)
    middles, smooth, places = [none], [none], [np.empty((0, 3))]
    for name, exact in size.surfaces.items():
        triangles = mesh.sides[name]
        corners = np.unique(triangles[:, :3])
        points[corners] = exact.project(points[corners], held(points[corners]))
        if mesh.order == 1:
            continue
        of_name, first = np.unique(triangles[:, 3:].T.ravel(), return_index=True)
        ends = points[np.concatenate([triangles[:, pair] for pair in EDGES[2]])[first]]
        centres, lengths = ends.mean(axis=1), np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        target = exact.project(centres, held(mesh.points[of_name]))
        bends = np.linalg.norm(target - centres, axis=1)
        # A node that moves farther has been projected to another part of the surface.
        near = bends <= 0.3 * lengths
        if name in size.bodies and not size.region.holes[name].solid.sharp:
            smooth.append(of_name)
        middles.append(of_name[near])
        places.append(target[near])
    mesh = replace(mesh, points=points)
    if mesh.order == 1:
        return mesh, none
    feet, layered = np.full(len(points), -1), tuple[Any, ...]()
    if columns is not None:
        feet, share = columns.by_point(len(points))
        layered = feet, AT_TOP + (1.0 - AT_TOP) * share
    # In a bed's valleys cells lie between two facets, and moving their other nodes unfolds none of them.
    at_grains = np.concatenate([none, *(mesh.sides[name].ravel() for name in size.bodies)])
    at_grains = np.union1d(at_grains, np.flatnonzero(np.isin(feet, at_grains)))
    beside = np.unique(mesh.cells[np.isin(mesh.cells, at_grains).any(axis=1)])
    free = np.zeros(points.shape, dtype=bool)
    free[beside] = ~held(mesh.points)[beside]
    free[np.concatenate([mesh.sides[name].ravel() for name in size.surfaces])] = False
    free[feet >= 0] = False
    moved = np.concatenate(middles), np.concatenate(places)
    curved, straight = mesh.curved(*moved, free, *layered)
    return curved, np.intersect1d(straight, np.concatenate(smooth))
