"""A grain and a bed added as docs/contribute/adding.md says: section and geometry, registered, and then run.

The grain is a stadium, a square with a half-disc on two sides; the bed is a sawtooth. Numbers are exact lengths and
areas, and the equilibrium of a grain on two slopes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from pydantic import Field

import incipient
from incipient import geometry
from incipient.arrays import planar_cross
from incipient.errors import SceneError
from incipient.geometry.plane.curves import Curve
from incipient.scene import Scene, dumps, loads, register
from incipient.scene.section import Positive
from incipient.scene.shapes import BedSection, GrainSection

# -- the grain: its geometry, and its section -------------------------------------------------------


@dataclass(frozen=True)
class Capsule(geometry.Grain):
    """All points within a radius of the straight line from (-half, 0) to (half, 0)."""

    half: float
    radius: float

    @property
    def size(self) -> float:
        """From one end to the other."""
        return 2.0 * (self.half + self.radius)

    def outline(self) -> tuple[Curve, ...]:
        """Counter-clockwise from the lower left end of the lower side; arcs are shorter than half a turn."""
        a, r = self.half, self.radius
        right, left = (a, 0.0), (-a, 0.0)
        return (
            geometry.Line((-a, -r), (a, -r)),
            geometry.Arc((a, -r), right, (a + r, 0.0)),
            geometry.Arc((a + r, 0.0), right, (a, r)),
            geometry.Line((a, r), (-a, r)),
            geometry.Arc((-a, r), left, (-a - r, 0.0)),
            geometry.Arc((-a - r, 0.0), left, (-a, -r)),
        )


class Stadium(GrainSection):
    """A rectangle with half-discs on two sides."""

    shape: Literal["stadium"] = Field("stadium", description="Shape of the grain")
    straight: Positive = Field(description="Length of the straight sides [length]")
    diameter: Positive = Field(description="Distance of these sides [length]")

    def new_grain(self) -> Capsule:
        """The grain's shape in its body frame."""
        return Capsule(0.5 * self.straight, 0.5 * self.diameter)


# -- the bed: its geometry is a polyline over more than the domain -----------------------------------


class Sawtooth(BedSection):
    """Symmetric teeth of straight lines, with a valley at x = 0."""

    kind: Literal["sawtooth"] = Field("sawtooth", description="Kind of bed")
    tooth: Positive = Field(description="Length of a tooth [length]")
    height: Positive = Field(description="Height of a tooth [length]")

    def forms(self, length: float) -> float:
        """Teeth."""
        return length / self.tooth

    def surface(self, origin_y: float, origin_x: float = 0.0) -> geometry.Bed:
        """The bed's shape above its base line y = origin_y, abscissae counted from origin_x."""
        x = 0.5 * self.tooth * np.arange(-8, 9) - origin_x
        return geometry.Polyline(np.column_stack([x, self.height * (np.arange(17) % 2)]), origin_y)


ADDED = """\
[domain]
length = 3.5
height = 4.0
origin = [-1.5, 0.0]
[fluid]
reynolds = 1.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "stadium"
straight = 0.5
diameter = 0.6
x = 0.0
density = 2.0
[bed]
kind = "sawtooth"
tooth = 1.0
height = 0.2
[gravity]
acceleration = 500.0
[contact]
friction = 0.5
[numerics]
mesh_size = 4.0
order = 2
error_bars = false
[output]
fields = false
"""


@pytest.fixture
def added() -> Iterator[None]:
    """The two kinds, for one test."""
    fields = [Scene.model_fields[key] for key in ("body", "bed")]
    before = [field.annotation for field in fields]
    register(Stadium)
    register(Sawtooth)
    yield
    for field, annotation in zip(fields, before, strict=True):
        field.annotation = annotation
    Scene.model_rebuild(force=True)


def test_the_grain_is_what_its_outline_encloses() -> None:
    """By Green's theorem on its outline: the area, and the moment about the centroid."""
    grain = Capsule(0.25, 0.3)
    points = np.vstack([curve.point(np.linspace(0.0, 1.0, 2000)) for curve in grain.outline()])
    area = moment = 0.0
    for (x, y), (u, v) in pairwise(points):
        twice = x * v - u * y
        area += 0.5 * twice
        moment += twice * (x * x + x * u + u * u + y * y + y * v + v * v) / 12.0
    assert grain.volume == pytest.approx(area, rel=1e-6)
    assert grain.inertia[2, 2] == pytest.approx(moment, rel=1e-6)


@pytest.mark.usefixtures("added")
def test_a_grain_and_a_bed_that_are_registered_are_planned_meshed_solved_and_judged() -> None:
    scene = loads(ADDED)
    assert loads(dumps(scene)) == scene
    slope = math.atan2(0.2, 0.5)
    # It lies across the valley, its round ends on two slopes.
    placement = scene.placement
    assert placement is not None
    assert placement.centre == pytest.approx(
        (0.0, 0.3 / math.cos(slope) + 0.25 * math.tan(slope)), abs=1e-9
    )
    result = incipient.run(scene)
    assert result.status == "complete"
    assert result.force is not None and result.torque is not None and result.verdict is not None
    flow, couple = result.force.flow[:2], result.torque.flow[2]
    weight = (result.force.weight + result.force.buoyancy)[:2]
    assert flow[0] > 0.0
    assert weight[1] == pytest.approx(-(2.0 - 1.0) * 500.0 * scene.grain.volume)
    # The flow is stronger by the safety factor when the moment about the contact downstream vanishes.
    away = 0.3 * np.array([-math.sin(slope), math.cos(slope)]) - [0.25, 0.0]
    pivots = -float(planar_cross(away, weight)) / (float(planar_cross(away, flow)) + couple)
    assert result.verdict["mode"] == "rest"
    assert result.verdict["safety_factor"] == pytest.approx(pivots, rel=1e-9)


@pytest.mark.usefixtures("added")
def test_what_is_wrong_in_them_is_said_like_of_all_others() -> None:
    with pytest.raises(SceneError, match=r"body\.diameter"):
        loads(ADDED.replace("diameter = 0.6", "diameter = -1"))
    with pytest.raises(SceneError, match='did you mean "sawtooth"'):
        loads(ADDED.replace('"sawtooth"', '"sawtoth"'))


@pytest.mark.usefixtures("added")
def test_no_two_kinds_have_one_name() -> None:
    with pytest.raises(
        SceneError, match=r'^Stadium: shape = "stadium" is used by another section; '
    ):
        register(Stadium)


def test_without_registration_there_is_no_such_grain() -> None:
    with pytest.raises(SceneError, match=r'"stadium" is not known'):
        loads(ADDED)
