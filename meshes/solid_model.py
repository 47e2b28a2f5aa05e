"""gmsh models of regions in space: graded tetrahedra, curved along grains and bed, with the boundaries named."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from incipient.errors import MeshError
from incipient.geometry.space.remeshing import ExactSurface, remeshed, without_area
from incipient.geometry.space.surfaces import Surface, crossed, joined
from incipient.interrupt import handlers_kept

from .curving import curved
from .exact import Ground, bodies_of
from .model import complaints_as_errors, generate, session, set_background, view_field
from .region import Sizes
from .shell import Shell, Walls, closed_shell
from .solid_region import SolidFrame, SolidRegion
from .solid_sizes import SizeMap, boxes
from .tetrahedra import Tetrahedra
from .wall_layers import Columns, layered

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

OTHERWISE = 1.07  # factor of the first triangles of a bed from one attempt to the next
ATTEMPTS = 4  # at surfaces that do not cross, each finer where they did


@contextmanager
def solid_model(region: SolidRegion, sizes: Sizes, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a region meshed with tetrahedra of order 1 or 2. Not collective: one rank draws.

    Raises MeshError if a surface is open or meets itself or another one, or gmsh finds no mesh.
    """
    if order not in (1, 2):
        raise MeshError(
            f"cells in space are of order 1 or 2, not {order}: change numerics.geometry_order"
        )
    with session() as model:
        with complaints_as_errors():
            frame = SolidFrame.of(region)
            outline = Outline(region, frame)
            size = SizeMap(region, sizes, frame, outline.ground, outline.bodies)
            size, bed, bodies = outline.triangulated(size)
            cubes = boxes(size, float(bed.points[:, 2].min()))
            rows = np.concatenate(
                [cubes.corners.transpose(0, 2, 1).reshape(-1, 24), cubes.sizes], axis=1
            )
            set_background(view_field("SH", rows))
            shell = closed_shell(_walls(region, frame), bed, bodies)
            made, columns = _mesh(shell), None
            if sizes.layers is not None:
                made, columns = layered(made, sizes.layers.scaled(1.0 / frame.length))
            made = _in_place(region, frame, outline, made.of_order(order), columns)
            gmsh.clear()
            made.put()
        yield model


class Outline:
    """The curved part of a region's boundary: the bed and the grains."""

    def __init__(self, region: SolidRegion, frame: SolidFrame):
        self.ground, self.bodies = Ground(region, frame), bodies_of(region, frame)

    def triangulated(self, size: SizeMap) -> tuple[SizeMap, Surface, dict[str, Surface]]:
        """The bed and the grains as triangles of the sizes wanted, and those sizes: finer where surfaces would cross.

        Raises MeshError if a grain reaches into the bed, or surfaces cross however fine they are.
        """
        bed_name = size.region.names[5]
        named: dict[str, ExactSurface] = {bed_name: self.ground, **self.bodies}
        found: dict[str, Surface] = {}
        for attempt in range(ATTEMPTS):
            found = {name: remeshed(exact, exact.draft(), size) for name, exact in named.items()}
            self._require_clear(found)
            whole = joined(list(found.values()))
            wrong = np.union1d(crossed(whole), without_area(whole))
            if not len(wrong):
                bed = found.pop(bed_name)
                return size, bed, found
            ends = np.cumsum([len(surface.triangles) for surface in found.values()])
            crossing = [
                list(named)[k] for k in np.unique(np.searchsorted(ends, wrong, side="right"))
            ]
            # Balls that cross themselves may have been folded by their first triangles: others come before finer ones.
            folded = crossing == [bed_name] and self.ground.of_balls
            if folded:
                named[bed_name] = replace(self.ground, finer=OTHERWISE ** (attempt + 1))
            if attempt or not folded:
                size = size.finer_at(whole.corners[wrong].mean(axis=1))
        remedy = "use a smaller numerics.mesh_size, or a wider contact.gap"
        if len(crossing) == 1:  # cells made half as large again and again have not helped
            remedy = f"make {crossing[0]} thicker or blunter there, or round its edges"
        raise MeshError(
            f"the surface of {' and that of '.join(crossing)} cross{'es itself' if len(crossing) == 1 else ''} in "
            f"{len(wrong)} triangles near {np.round(size.frame.scene(size.spots[-1:])[0], 6).tolist()}: {remedy}"
        )

    def _require_clear(self, found: dict[str, Surface]) -> None:
        for name in self.bodies:
            points = found[name].points
            inside = int((self.ground.distance(points) <= 0.0).sum())
            if inside:
                raise MeshError(
                    f'"{name}" reaches into the bed with {inside} of {len(points)} points: lift it'
                )


def _walls(region: SolidRegion, frame: SolidFrame) -> Walls:
    low, high = (frame.local(np.array([[*end, 0.0]]))[0, :2] for end in region.rectangle)
    return Walls(low, high, region.names)


def _mesh(shell: Shell) -> Tetrahedra:
    """Fill a shell with straight tetrahedra."""
    tags = {}
    numbers = np.arange(1, len(shell.points) + 1)
    for number, name in enumerate(shell.triangles, start=1):
        tags[name] = gmsh.model.addDiscreteEntity(2, number)
        if number == 1:
            gmsh.model.mesh.addNodes(2, number, numbers.tolist(), shell.points.ravel().tolist())
    for name, triangles in shell.triangles.items():
        gmsh.model.mesh.addElementsByType(tags[name], 2, [], (triangles + 1).ravel().tolist())
    gmsh.model.mesh.reclassifyNodes()
    loop = gmsh.model.geo.addSurfaceLoop(list(tags.values()))
    gmsh.model.geo.addVolume([loop])
    gmsh.model.geo.synchronize()
    generate(3)
    return Tetrahedra.read(tags)


def _in_place(
    region: SolidRegion,
    frame: SolidFrame,
    outline: Outline,
    made: Tetrahedra,
    columns: Columns | None,
) -> Tetrahedra:
    """The cells with their points on the exact surfaces, in the scene."""
    walls = _walls(region, frame)
    planes = tuple((axis, float(end[axis])) for axis in (0, 1) for end in (walls.low, walls.high))
    found, straight = curved(
        made, {region.names[5]: outline.ground, **outline.bodies}, planes, columns
    )
    gmsh.logger.write(
        f"cells would fold over: {straight} edges are straight", "warning" if straight else "info"
    )
    return replace(found, points=frame.scene(found.points))
