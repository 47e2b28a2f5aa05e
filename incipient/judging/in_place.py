"""Cases of a grain and a bed in another program's coordinates, from files of triangles or simple shapes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field
from scipy.spatial import QhullError
from scipy.spatial.transform import Rotation
from trimesh.bounds import oriented_bounds_2D
from trimesh.geometry import align_vectors

from ..arrays import Floats, unit
from ..errors import SceneError, refuse_broken
from ..geometry import HeightMap, Placement, Plane
from ..geometry.settle import proximity, touching_under
from ..geometry.space.files import triangles_in
from ..geometry.space.grains import Solid, Triangulated
from ..scene.file import parse
from ..scene.grains import SolidBody, mass_and_inertia
from ..scene.messages import refused
from ..scene.section import NotNegative, Positive, PositivePair, Rule, Section, Triple, key
from .case import Case, CaseErrors

FLAT = "flat"  # instead of a file: a plane below the grain
SOURCE = "--forces without a case (give keys by --set)"
BORDER = 1e-6  # relative, of the bed of a file, which is left out: files hold single precision


def _not_zero(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(direction):
        raise refused("is zero", "give the components of a direction, as in [0, -1, 0]")
    return direction


Direction = Annotated[Triple, AfterValidator(_not_zero)]


class ForcesFluid(Section):
    """The fluid of the other program."""

    density: Positive = key(
        "Density of the fluid in the units of the forces after --density: 1 if rhoInf is 1"
    )


class ForcesGravity(Section):
    """Gravity in the coordinates of the other program."""

    acceleration: NotNegative = key("Gravitational acceleration, in the units of the forces")
    direction: Direction = key("Direction of gravity", (0.0, 0.0, -1.0))


class ForcesBed(Section):
    """The bed in the coordinates of the other program."""

    rules = (
        Rule("height", lambda s: s.height is not None and s.file != FLAT,
             "is that of a plane, and a file is given", "leave it out"),
    )  # fmt: skip

    file: str = key("STL, PLY or OBJ file of the bed, or flat: a plane")
    up: Direction | None = key("Upward direction of the bed; default: against gravity", None)
    height: float | None = key(
        "Height of a plane along `up`; default: that of the grain's lowest point", None
    )
    cell: PositivePair | None = key(
        "Spacing of the heights sampled from a file, as of a scene's bed", None
    )


class ForcesContact(Section):
    """The contact of grain and bed."""

    friction: NotNegative = key("Coefficient of static friction")
    cohesion: NotNegative = key(
        "Largest tensile force of each contact (coplanar points are one)", 0.0
    )
    tolerance: Positive = key("Distance that counts as contact, over the grain's size", 1e-6)


class GrainInPlace(Section):
    """Keys of --set with --grain and --bed."""

    rules = (
        Rule("body", lambda s: s.body.centre is None,
             "has no centre", "give body.centre, where the other program has the grain"),
        Rule("body", lambda s: mass_and_inertia(s.body) is None,
             "has no mass", "give body.density, over the fluid's"),
    )  # fmt: skip

    body: Annotated[SolidBody, Field(discriminator="shape")]
    bed: ForcesBed
    fluid: ForcesFluid
    gravity: ForcesGravity
    contact: ForcesContact
    errors: CaseErrors | None = None

    def case(self) -> Case:
        """The case: contacts, weight less buoyancy, mass and inertia, without a load of the flow.

        Raises SceneError unless the grain touches the bed.
        """
        down, centre = unit(np.array(self.gravity.direction)), np.array(self.body.centre)
        grain, placement = self.body.grain, self.body.placed(tuple(centre.tolist()))
        frame = align_vectors(
            -down if self.bed.up is None else unit(np.array(self.bed.up)), [0, 0, 1]
        )[:3, :3]
        triangles = None
        if self.bed.file != FLAT:
            points, numbers = triangles_in(self.bed.file)
            frame = _narrowest(points @ frame.T) @ frame
            triangles = (points @ frame.T)[numbers]
        turn = Rotation.from_matrix(frame).as_rotvec()
        above = placement.moved(frame @ centre - centre, turn)
        bed = self._bed(triangles, grain, above)
        _require_touching(grain, above, bed, self.contact.tolerance)
        near_bed, within = proximity(grain, bed), self.contact.tolerance * grain.size
        contacts = touching_under(near_bed, above, frame @ down, within)
        inert = mass_and_inertia(self.body, placement)
        assert inert is not None
        mass, inertia = self.fluid.density * inert[0], self.fluid.density * inert[1]
        submerged = mass - self.fluid.density * grain.volume
        return Case.model_validate(
            {
                "title": f"Grain of volume {grain.volume:.6g} in place",
                "load": {
                    "weight": submerged * self.gravity.acceleration * down,
                    "centre": centre,
                },
                "contacts": {
                    "points": list(contacts.points @ frame),
                    "normals": list(contacts.normals @ frame),
                    "areas": None if contacts.areas is None else contacts.areas.tolist(),
                    "friction": self.contact.friction,
                    "cohesion": self.contact.cohesion,
                    "convex": False,
                },
                "grain": {"mass": mass, "inertia": inertia},
                "errors": self.errors,
            }
        )

    def _bed(self, triangles: Floats | None, grain: Solid, above: Placement) -> HeightMap | Plane:
        if triangles is None:
            height = self.bed.height
            gap = proximity(grain, Plane()).clearance(above)[0]
            return Plane(origin_z=gap if height is None else height)
        low, high = triangles.min(axis=(0, 1))[:2], triangles.max(axis=(0, 1))[:2]
        margin, middle = BORDER * (high - low).max(), np.array(above.centre[:2])
        low = np.maximum(low + margin, middle - grain.size)
        high = np.minimum(high - margin, middle + grain.size)
        x, y = zip(low.tolist(), high.tolist(), strict=True)
        try:
            bed = HeightMap.of_triangles(triangles, self.bed.cell, Path(self.bed.file), (x, y))
        except SceneError as error:
            raise SceneError(
                f"--bed: {error}; upwards is against gravity.direction, or bed.up"
            ) from None
        return _plane(bed, BORDER * grain.size) or bed


def grain_in_place(grain: Path | None, bed: Path | None, overrides: Sequence[str]) -> Case:
    """The case of a grain on its bed.

    Args:
        grain: file of its surface, in the coordinates of the other program; None: overrides such as
            "body.shape=sphere" give it.
        bed: file of its surface, or "flat".

    Raises SceneError if something is missing or wrong, or the grain does not touch its bed.
    """
    has_shape = any(override.startswith("body.shape") for override in overrides)
    refuse_broken(
        (
            grain is None and not has_shape,
            "--forces without a case: --grain is missing; give the file of its surface, or body.shape",
        ),
        (
            bed is None,
            "--forces without a case: --bed is missing; give the file of its surface, or flat",
        ),
    )
    files = [f"bed.file={json.dumps(str(bed))}"]
    if grain is not None:
        centre = Triangulated.from_file(grain).centre.tolist()  # after its triangles are repaired
        files += ["body.shape=mesh", f"body.file={json.dumps(str(grain))}", f"body.centre={centre}"]
    sections = "[fluid]\n[gravity]\n[contact]"  # so that their keys are reported as missing
    return parse(GrainInPlace, sections, ".", [*files, *overrides], SOURCE).case()


def _require_touching(
    grain: Solid, placement: Placement, bed: HeightMap | Plane, tolerance: float
) -> None:
    gap = proximity(grain, bed).clearance(placement)[0] / grain.size
    is_below = float(bed.height([placement.centre[:2]])[0]) > placement.centre[2]
    remedy = "give a larger contact.tolerance, in grain sizes, or another gravity.direction"
    refuse_broken(
        (
            gap < -tolerance and is_below,
            "--bed: the grain is below the bed; reverse gravity.direction, or give bed.up",
        ),
        (gap < -tolerance, f"--bed: the grain is in the bed, by {-gap:.3g} of its size; {remedy}"),
        (
            gap > tolerance,
            f"--bed: the grain is {gap:.3g} of its size above the bed; {remedy}",
        ),
    )


def _narrowest(points: Floats) -> Floats:
    turn = np.eye(3)
    with suppress(QhullError):  # all are on one line
        turn[:2, :2] = oriented_bounds_2D(points[:, :2])[0][:2, :2]
    return turn


def _plane(bed: HeightMap, tolerance: float) -> Plane | None:
    across, along = np.indices(bed.heights.shape).reshape(2, -1)
    x, y = bed.origin[0] + bed.cell[0] * along, bed.origin[1] + bed.cell[1] * across
    table, heights = np.column_stack([x, y, np.ones(len(x))]), bed.heights.ravel() + bed.origin[2]
    plane = np.linalg.lstsq(table, heights, rcond=None)[0]
    if np.abs(table @ plane - heights).max() > tolerance:
        return None
    return Plane((float(plane[0]), float(plane[1])), float(plane[2]))
