"""A grain and its bed where another program has them, from files of triangles or simple shapes: a case without load."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.spatial import ConvexHull, QhullError

from ..arrays import Floats, cross, unit
from ..errors import SceneError
from ..evaluation.contact_verdict import mass_and_inertia
from ..geometry import HeightMap, Placement, Plane, clearance
from ..geometry.closest import touching
from ..geometry.placement import Quaternion, product, rotation_by
from ..geometry.space.files import triangles_in
from ..geometry.space.grains import Solid, Triangulated
from ..scene.file import parse
from ..scene.section import NotNegative, Positive, PositivePair, Section, Triple, contradiction, key
from ..scene.solids import SolidBody
from .judge_case import Case, CaseErrors

FLAT = "flat"  # in place of a file: a plane below the grain
_NEEDED = {
    "body.density": "relative to the fluid's",
    "fluid.density": "of the fluid in the units of the forces after --density, 1 if rhoInf is 1",
    "gravity.acceleration": "in the units of the forces",
    "contact.friction": "the coefficient of static friction",
}
BORDER = 1e-6  # of the bed of a file, which is left out: files hold single precision
LEAST_TURN = 1e-12  # cosine to one, within which directions are the same


def _direction(value: tuple[float, ...] | None) -> tuple[float, ...] | None:
    if value is not None and not any(value):
        raise contradiction("is zero", "give the components of a direction, as in [0, -1, 0]")
    return value


class ForcesFluid(Section):
    """The fluid of the other program."""

    density: Positive = key(
        "Density of the fluid in the units of the forces after --density: 1 if rhoInf is 1"
    )


class ForcesGravity(Section):
    """Gravity in the coordinates of the other program."""

    acceleration: NotNegative = key("Gravitational acceleration, in the units of the forces")
    direction: Triple = key("Direction of gravity", (0.0, 0.0, -1.0))

    _not_zero = field_validator("direction")(_direction)


class ForcesBed(Section):
    """The bed in the coordinates of the other program."""

    file: str = key("STL, PLY or OBJ file of the bed, or flat: a plane")
    up: Triple | None = key(
        "Direction in which the bed is seen from above; default: against gravity", None
    )
    height: float | None = key(
        "Of a plane its height along `up`; default: that of the grain's lowest point", None
    )
    cell: PositivePair | None = key(
        "Of a file: distance between the heights taken, as of a scene's bed", None
    )

    _not_zero = field_validator("up")(_direction)

    @model_validator(mode="after")
    def _fits(self) -> ForcesBed:
        if self.height is not None and self.file != FLAT:
            raise self.refused("height", "is that of a plane, and a file is given", "leave it out")
        return self


class ForcesContact(Section):
    """The contact of grain and bed."""

    friction: NotNegative = key("Coefficient of static friction")
    tolerance: Positive = key("Distance that counts as touching, over the grain's size", 1e-6)


class GrainInPlace(Section):
    """What --set says beside --grain and --bed."""

    body: Annotated[SolidBody, Field(discriminator="shape")]
    bed: ForcesBed
    fluid: ForcesFluid
    gravity: ForcesGravity
    contact: ForcesContact
    errors: CaseErrors | None = None

    @model_validator(mode="after")
    def _is_placed(self) -> GrainInPlace:
        if self.body.centre is None:
            raise self.refused(
                "body", "has no centre", "give body.centre, where the other program has the grain"
            )
        if mass_and_inertia(self.body) is None:
            raise self.refused("body", "has no mass", "give body.density, relative to the fluid's")
        return self

    @property
    def down(self) -> Floats:
        """Direction (3,) of gravity."""
        return unit(np.array(self.gravity.direction))

    def case(self) -> Case:
        """The case: contacts as found, weight less buoyancy, mass and inertia; no load of the flow.

        Raises SceneError where the grain does not touch the bed.
        """
        assert self.body.centre is not None
        turn = _turn(-self.down if self.bed.up is None else unit(np.array(self.bed.up)))
        triangles = None
        if self.bed.file != FLAT:
            points, numbers = triangles_in(self.bed.file)
            turn = product(_squared(points @ _matrix(turn).T), turn)
            triangles = (points @ _matrix(turn).T)[numbers]
        upright = _matrix(turn)
        placement, grain = self.body.placed(self.body.centre), self.body.grain()
        assert placement.quaternion is not None
        above = Placement(
            tuple(upright @ self.body.centre), quaternion=product(turn, placement.quaternion)
        )
        bed = self._bed(triangles, above)
        _require_touching(grain, above, bed, self.contact.tolerance)
        found = touching(grain, above, bed, self.contact.tolerance * grain.size)
        inert = mass_and_inertia(self.body, placement)
        assert inert is not None
        heavy, inertia = self.fluid.density * inert[0], self.fluid.density * inert[1]
        displaced = self.fluid.density * grain.volume
        contacts = {
            "points": (found.points @ upright).tolist(),
            "normals": (found.normals @ upright).tolist(),
            "areas": None if found.areas is None else found.areas.tolist(),
            "friction": self.contact.friction,
            "convex": False,
        }
        none = (0.0, 0.0, 0.0)
        weight = (heavy - displaced) * self.gravity.acceleration * self.down
        load = {
            "weight": weight.tolist(),
            "flow_force": none,
            "flow_couple": none,
            "centre": self.body.centre,
        }
        data = {
            "load": load,
            "contacts": contacts,
            "grain": {"mass": heavy, "inertia": inertia.tolist()},
        }
        return Case.model_validate(
            {"title": f"Grain of volume {grain.volume:.6g} in place", "errors": self.errors, **data}
        )

    def _bed(self, triangles: Floats | None, above: Placement) -> HeightMap | Plane:
        """The bed, upright: of a file the part about the grain."""
        grain = self.body.grain()
        if triangles is None:
            lowest = clearance(grain, above, Plane())[0]
            return Plane(origin_z=lowest if self.bed.height is None else self.bed.height)
        low, high = triangles.min(axis=(0, 1))[:2], triangles.max(axis=(0, 1))[:2]
        margin = BORDER * float((high - low).max())
        middle = np.array(above.centre[:2])
        x, y = np.stack(
            [
                np.maximum(low + margin, middle - grain.size),
                np.minimum(high - margin, middle + grain.size),
            ],
            axis=1,
        ).tolist()
        try:
            bed = HeightMap.of_triangles(
                triangles, self.bed.cell, Path(self.bed.file), (tuple(x), tuple(y))
            )
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

    Raises:
        SceneError: something is missing or wrong, or the grain does not touch its bed.
    """
    keys = {one.partition("=")[0].strip() for one in overrides}
    if grain is None and "body.shape" not in keys:
        raise SceneError(
            "--forces without a case: --grain is missing; give the file of its surface, or body.shape"
        )
    if bed is None:
        raise SceneError(
            "--forces without a case: --bed is missing; give the file of its surface, or flat"
        )
    for name, what in _NEEDED.items():
        if name not in keys and not (name == "body.density" and "body.mass" in keys):
            raise SceneError(
                f"--forces without a case: {name} is missing; add --set {name}=NUMBER, {what}"
            )
    given = [f"bed.file={json.dumps(str(bed))}"]
    if grain is not None:
        centre = Triangulated.from_file(grain).centre.tolist()  # after its triangles are repaired
        given += ["body.shape=mesh", f"body.file={json.dumps(str(grain))}", f"body.centre={centre}"]
    return parse(GrainInPlace, "", ".", [*given, *overrides], "--grain and --bed").case()


def _require_touching(
    grain: Solid, placement: Placement, bed: HeightMap | Plane, tolerance: float
) -> None:
    """Refuse a grain that is above or in the bed by more than a tolerance, in grain sizes."""
    gap = clearance(grain, placement, bed)[0] / grain.size
    if abs(gap) <= tolerance:
        return
    remedy = "give a larger contact.tolerance, in grain sizes, or another gravity.direction"
    why = f"{gap:.3g} of its size above the bed"
    if gap < 0.0:
        why = f"in the bed, by {-gap:.3g} of its size"
        if float(bed.height([placement.centre[:2]])[0]) > placement.centre[2]:
            why = "below the bed"
            remedy = "turn gravity.direction round, or give bed.up, from where the bed is seen"
    raise SceneError(f"--bed: the grain is {why}; {remedy}")


def _turn(up: Floats) -> Quaternion:
    """The rotation that brings a direction upwards, as a quaternion."""
    axis, cosine = cross(up, np.eye(3)[2]), float(up[2])
    if cosine < -1.0 + LEAST_TURN:
        return rotation_by(np.array([np.pi, 0.0, 0.0]))
    return rotation_by(np.arccos(np.clip(cosine, -1.0, 1.0)) * unit(axis))


def _matrix(turn: Quaternion) -> Floats:
    return Placement((0.0, 0.0, 0.0), quaternion=turn).rotation


def _squared(points: Floats) -> Quaternion:
    """The rotation about the third axis that puts points (n, 3), seen from above, into the narrowest rectangle."""
    try:
        around = points[ConvexHull(points[:, :2]).vertices, :2]
    except QhullError:  # all are on one line
        return rotation_by(np.zeros(3))
    sides = np.roll(around, -1, axis=0) - around
    along = unit(sides)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    areas = np.ptp(around @ along.T, axis=0) * np.ptp(around @ across.T, axis=0)
    way = along[int(areas.argmin())]
    return rotation_by(np.array([0.0, 0.0, -np.arctan2(way[1], way[0])]))


def _plane(bed: HeightMap, tolerance: float) -> Plane | None:
    """The plane that all heights of a bed are on, to a tolerance, if there is one."""
    x, y = np.meshgrid(
        *(bed.cell[axis] * np.arange(bed.heights.shape[1 - axis]) for axis in (0, 1))
    )
    table = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    (along, across, level), *_ = np.linalg.lstsq(table, bed.heights.ravel(), rcond=None)
    if np.abs(table @ [along, across, level] - bed.heights.ravel()).max() > tolerance:
        return None
    start = bed.origin[2] + level - along * bed.origin[0] - across * bed.origin[1]
    return Plane((float(along), float(across)), float(start))
