"""Geometry and cell sizes of a scene, ready for gmsh."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..errors import SceneError
from ..geometry.plane.closing import Closing
from ..geometry.space.beds import SmoothTerrain
from ..installed import required
from ..meshes import Grid, Region, SizeField, Sizes, SolidRegion
from ..meshes.expected import expected_cells
from ..setup.geometry import Stance

if TYPE_CHECKING:
    from ..meshes.simplices import Simplices

# Cells expected, by dimension, from which it is said that mesh and flow take long.
MANY_CELLS = {2: 20_000, 3: 50_000}
# Slope of a 3-D bed: one of 1.9 is meshed in seconds, of one of 5.7 triangles cross for minutes
STEEP = 2.5
STEEPEST = 0.35  # growth of coarse cells with distance


@dataclass(frozen=True, kw_only=True)
class Layout(Stance):
    """A scene's geometry with the grain placed.

    max_cells: expected triangles, in 3-D tetrahedra, above which no mesh is made
    closing: the closed space next to the contacts of a grain; None: open
    """

    shape: Region | SolidRegion | Grid
    sizes: Sizes
    geometry_order: int
    max_cells: float
    closing: Closing | None = None

    @property
    def gdim(self) -> int:
        if isinstance(self.shape, Grid):
            return len(self.shape.extents)
        return 3 if isinstance(self.shape, SolidRegion) else 2

    def mesh(self) -> Simplices:
        """The mesh, on one rank only.

        Raises:
            MeshError: the geometry cannot be meshed.
            SceneError: too many cells are expected.
            MissingError: gmsh, or a library that it needs, is not installed.
        """
        self._require_few_cells()
        with required():
            from ..meshes.model import meshed
        return meshed(self.shape, self.sizes, self.geometry_order)

    def _require_few_cells(self) -> None:
        parts = expected_cells(self.shape, self.sizes)
        expected, most = sum(parts.values()), max(parts, key=lambda name: parts[name])
        if not expected <= self.max_cells:
            of_contact = self.resting is not self.placement and most.startswith("narrow places")
            smallest = "contact.gap" if of_contact else "numerics.mesh_size or the smallest length"
            raise SceneError(
                f"numerics.max_cells: a mesh of about {expected:.2g} cells is expected, most for the {most}, more than "
                f"{self.max_cells:g}; enlarge {smallest}, or allow them with "
                f"--set numerics.max_cells={_round_up(expected)}"
            )
        log = logging.getLogger("incipient")
        if expected > MANY_CELLS[self.gdim]:
            words = (
                "a mesh of about %.2g cells is made, most for the %s: mesh and flow take minutes"
            )
            log.info(words, expected, most)
        bed = self.shape.bed if isinstance(self.shape, SolidRegion) else None
        if isinstance(bed, SmoothTerrain) and bed.steepest > STEEP:
            words = "the bed rises by %.2g on 1: to mesh it takes minutes and may fail; give a flatter or smoother one"
            log.info(words, bed.steepest)


def _round_up(number: float) -> int:
    digits = 10 ** max(int(math.log10(max(number, 1.0))) - 1, 0)
    return (int(number / digits) + 1) * digits


def coarse_sizes(factor: float, field: SizeField | None, layout: Layout) -> Layout:
    """Default cell sizes times `factor`, except in gaps and where `field` prescribes sizes."""
    return replace(layout, sizes=replace(layout.sizes.coarsened(factor, STEEPEST), field=field))
