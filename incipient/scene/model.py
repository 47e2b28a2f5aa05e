"""A complete scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Union

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..arrays import Floats
from ..errors import SceneError
from ..geometry.placement import Placement
from ..geometry.proximity import Proximity
from ..geometry.settle import proximity
from .beds import Flat, PlaneBed, TerrainBed
from .expression import Expression, expressions
from .flows import ExpressionFlow, Flow, FlowSection, Gusts
from .grains import (
    DEFAULT_FRICTION,
    FRICTIONLESS,
    LEVEL,
    PlaneBody,
    SolidBody,
    inertia_tensor,
    mass,
    mean_density,
    rested,
)
from .messages import Refused, discriminator, tag, variants
from .rules import OF_UNITS, PLACES, RULES, WITHOUT_UNITS
from .section import Section, Title, first_broken, key
from .sections import (
    FREE,
    OF_GRAIN,
    OF_WALLS,
    Contact,
    Domain,
    Effects,
    Fluid,
    Gravity,
    Numerics,
    Output,
    Sides,
    Surface,
    Time,
    Top,
    Turbulence,
)
from .units import Scales, Units, derived, scales_of

Body = Annotated[PlaneBody | SolidBody, Field(discriminator="shape")]
Bed = Annotated[PlaneBed | TerrainBed, Field(discriminator="kind")]

NO_CONTACT = Contact(friction=0.0)  # its gap and tolerance are those of a scene without [contact]
ALIKE = 1e-6  # of the grain's size, or of a field's range: differences below it do not count
MIRRORED = np.array([1.0, -1.0, 1.0])  # factors on the components of a mirrored field
SAMPLES = 20_000  # points and times at which a formula is compared with its mirror image
# Name, values (k, n) at points (n, 3), factors on those of a mirrored field, points.
Compared = tuple[str, Callable[[Floats], Any], Floats, Floats]


class Scene(Section):
    """A complete and consistent scene.

    Raises SceneError: names the key, the reason and the remedy.
    """

    title: Title = key("Title of the scene", "")
    domain: Domain = key("The region that the fluid may fill")
    fluid: Fluid = key("The fluid, of density 1")
    flow: Flow = key("The base flow")
    body: Body | None = key("The grain", None)
    bed: Bed | None = key("The bed, instead of the domain's lower side", None)
    gravity: Gravity | None = key(
        "Gravity, downwards, turned by the slope of an inclined bed", None
    )
    surface: Surface | None = key('The free surface, with domain.top = "free-surface"', None)
    turbulence: Turbulence | None = key("Turbulence, with effects.turbulence = true", None)
    contact: Contact | None = key("The contact of grain and bed", None)
    gusts: Gusts | None = key(
        "Fluctuations of the velocity at the grain, for incipient entrainment", None
    )
    units: Units | None = key(
        "SI units: then fluid.reynolds, gravity and body.density follow, and are left out", None
    )
    time: Time | None = key("Time dependence; without this section the flow is steady", None)
    effects: Annotated[Effects, BeforeValidator(lambda value: {} if value == "auto" else value)] = (
        key(
            "Effects to simulate; auto: chosen from the scene and its dimensionless numbers",
            Effects(),
        )
    )
    numerics: Numerics = key("How the equations are solved", Numerics())
    output: Output = key("Additional output", Output())

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        problems = first_broken(OF_UNITS if self.units else WITHOUT_UNITS, self)
        if self.units is not None and not problems:
            for (section, name), value in derived(self).items():
                part = getattr(self, section) or Gravity()
                if getattr(part, name) is None:
                    self.__dict__[section] = part.model_copy(update={name: value})
        rules = (*RULES, *self.flow.needs)
        problems = problems or [problem for rule in rules for problem in rule.problems(self)]
        if problems := problems or first_broken(PLACES, self):
            raise Refused(*problems)
        return self

    @property
    def scales(self) -> Scales | None:
        return None if self.units is None else scales_of(self)

    @property
    def gdim(self) -> int:
        return self.domain.gdim

    @property
    def up(self) -> int:
        """Index of the upward coordinate."""
        return self.gdim - 1

    @property
    def is_empty_box(self) -> bool:
        """Whether a closed box has neither grain, bed nor (in 3-D) free surface."""
        empty = self.domain.kind == "box" and self.body is None and self.bed is None
        return empty and (self.gdim == 2 or not self.has_surface)

    @property
    def has_centrelines(self) -> bool:
        """Whether velocities on the centrelines of a lid-driven box are reported."""
        return self.flow.moves_top and self.body is None

    @property
    def has_separation(self) -> bool:
        """Whether laminar separation and reattachment along the bed are reported: in 2-D, without a grain."""
        flows = not (self.flow.at_rest or self.flow.moves_top)
        flows = flows and not (self.has_surface or self.is_averaged)
        return self.gdim == 2 and self.bed is not None and self.body is None and flows

    @property
    def is_still(self) -> bool:
        """Whether nothing sets the fluid in motion."""
        return self.flow.is_zero and not (self.moves or self.has_surface)

    @property
    def no_error_bars(self) -> str:
        """Why requested error bars are not estimated, or ""."""
        estimated = self.body is not None or self.has_surface or self.is_averaged
        steady = self.time is None and (self.has_centrelines or self.has_separation)
        if estimated or steady or not self.numerics.error_bars:
            return ""
        return (
            "not estimated: laminar flow without a grain has them in steady flow only, of separation and reattachment "
            "along a bed in 2-D and of velocities on the centrelines of a driven box"
        )

    @property
    def top(self) -> Top:
        """The upper boundary; "auto" follows from the flow."""
        return self.flow.tops[0] if self.domain.top == "auto" else self.domain.top

    @property
    def sides(self) -> Sides:
        walled = self.domain.kind == "box" and not self.has_surface
        return self.domain.sides or ("wall" if walled else "slip")

    @property
    def has_surface(self) -> bool:
        return self.domain.top == FREE

    @property
    def accuracy_of(self) -> str:
        quantity = self.numerics.accuracy_of
        if quantity != "auto":
            return quantity
        if self.body is not None:
            return OF_GRAIN if self.body.is_free else "force"
        return OF_WALLS if self.is_averaged else "elevation"

    @property
    def has_forms(self) -> bool:
        """Whether there is a bed that is not flat."""
        return self.bed is not None and self.bed.kind != "flat"

    @property
    def is_averaged(self) -> bool:
        return self.effects.turbulence is True

    @property
    def resolves_walls(self) -> bool:
        return self.is_averaged and (self.turbulence or Turbulence()).model == "k-omega-sst"

    @property
    def resolves_uneven_walls(self) -> bool:
        """Whether in 3-D non-planar walls are resolved: loads then scatter from mesh to mesh."""
        uneven = self.body is not None or self.has_forms
        return uneven and self.resolves_walls and self.domain.width is not None

    @cached_property
    def grain(self) -> Any:
        return None if self.body is None else self.body.grain

    @property
    def mass(self) -> float | None:
        return None if self.body is None else mass(self.body)

    @property
    def density(self) -> float | None:
        return None if self.body is None else mean_density(self.body)

    @property
    def moves(self) -> bool:
        return self.body is not None and self.body.moves

    @property
    def rests(self) -> bool:
        return self.body is not None and self.bed is not None and self.body.x is not None

    @property
    def closes_contacts(self) -> bool:
        """Whether the space next to contacts is closed to the flow: only in 2-D turbulent flow.

        Laminar flow through a gap is so slow that loads are near their limit.
        """
        has_wall_functions = self.is_averaged and not self.resolves_walls
        return self.gdim == 2 and has_wall_functions and self.rests and not self.moves

    @cached_property  # compares thousands of points
    def asymmetry(self) -> str:
        """First difference of a 3-D scene from its mirror image in the vertical plane at mid-width, or ""."""
        middle, placement = self.domain.middle, self.placement
        if placement and abs(away := placement.centre[1] - middle) > ALIKE * self.grain.size:
            return f"the grain's centroid is {abs(away):.3g} from mid-width, y = {middle:g}"
        if self.moves and _is_turned_over(self):
            return "the grain's motion is not that of its mirror image"
        for name, values, factors, points in _fields(self):
            # The others are compared with these; a settled grain's centroid is within round-off of the plane.
            points = points[points[:, 1] >= middle - ALIKE * np.ptp(self.domain.across)]
            mirrored = points * MIRRORED + [0.0, 2.0 * middle, 0.0]
            here, there = (np.reshape(values(x), (-1, len(x))) for x in (points, mirrored))
            off = float(np.abs(here - factors[:, None] * there).max())
            if off > ALIKE * max(float(np.ptp([here, there])), 1e-300):
                return f"the {name} is {off:.2g} off its mirror image in y = {middle:g}"
        return ""

    @cached_property
    def bed_shape(self) -> Any:
        """The bed; without one the lower side, a plane."""
        return (self.bed or Flat()).shape(self.domain.bottom, (0.0,) * self.up)

    def bed_height(self, places: Floats) -> Floats:
        """Heights (n,) of the bed at places (n, gdim - 1 or more)."""
        over = places[:, 0] if self.gdim == 2 else places[:, :2]
        return np.asarray(self.bed_shape.height(over))

    @property
    def repeats_forms(self) -> bool:
        """Whether bedforms repeat at least twice; longer ones are a bed that rises and falls."""
        period = self.bed_shape.period
        return bool(period and self.domain.length >= 2.0 * period)

    @cached_property  # evaluates thousands of points
    def bed_heights(self) -> tuple[float, float]:
        """The bed's lowest and highest height."""
        spans, counts = self.domain.spans, (2001,) if self.gdim == 2 else (201, 201)
        places = self.domain.grid(*counts)
        if self.gdim == 2:
            places = np.vstack([places, self.bed_shape.corners(*spans[0])[:, None]])
        heights = self.bed_height(places)
        return float(heights.min()), max(float(heights.max()), self.bed_shape.crest_level(*spans))

    @cached_property  # read at every step; computing it takes longer than a step's solution
    def placement(self) -> Placement | None:
        """Placement in contact with the bed, settled, or at a given centre. Raises SceneError without rest."""
        body, corner = self.body, self.domain.origin
        if body is not None and body.centre is not None:
            return body.placed(body.centre)
        if body is None or body.x is None or self.bed is None:
            return None
        # Relative to the domain's corner: far from the origin, floating-point spacing is too coarse for settling.
        y = getattr(body, "y", None)
        over = (body.x, self.domain.entrance[1] if y is None else y)[: self.up]
        bed = self.bed.shape(0.0, corner[:-1])
        start = body.placed([*np.subtract(over, corner[:-1]), 0.0])
        if body.settle:
            upright = (*[0.0] * (self.gdim - 1), -1.0)
            down = upright if body.settle == LEVEL else tuple(self.gravity_direction)
            friction, cohesion = self.settling_law
            placement = rested(body.grain, bed, start, down, friction, cohesion, self.domain.length)
            if self.gdim == 3 and y is None and self._is_even_across:
                x, _, z = placement.centre
                placement = replace(placement, centre=(x, start.centre[1], z))
        else:
            placement = proximity(body.grain, bed).lowered(start)
        return placement.moved(corner, np.zeros(2 * self.gdim - 3))

    @property
    def settling_law(self) -> tuple[float, float]:
        """Friction, and cohesion in submerged weights, with which the grain settles.

        They are those of the verdict: where the weight alone is held, the grain has come to rest.
        """
        if self.body is not None and self.body.settle == FRICTIONLESS:
            return 0.0, 0.0
        if self.contact is None:
            return DEFAULT_FRICTION, 0.0
        heavier = (self.mass or 0.0) - self.grain.volume
        weight = heavier * float(np.linalg.norm(self.gravity_vector))
        # A grain without weight settles as a heavy one, which a pull hardly holds.
        return self.contact.friction, self.contact.cohesion / weight if weight > 0.0 else 0.0

    @property
    def _is_even_across(self) -> bool:
        """Whether the height of a 3-D bed does not depend on y."""
        # So many points along and across have no common period with bedforms.
        across = self.bed_shape.gradient(self.domain.grid(289, 103))[:, 1]
        return float(np.abs(across).max()) < 1e-12  # round-off

    @cached_property  # samples the grain's surface
    def near_bed(self) -> Proximity:
        return proximity(self.grain, self.bed_shape)

    @property
    def reference_length(self) -> float:
        """L of the Reynolds number: the grain's largest diameter or the height of the domain."""
        grain = self.grain if self.fluid.scale == "grain" else None
        return self.domain.height if grain is None else grain.size

    @property
    def reference_velocity(self) -> float:
        """V of the Reynolds number: shear rate times L, u* of a log law, otherwise the flow's velocity."""
        return self.flow.reference_velocity(self.reference_length)

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity V L / Re in scene units."""
        return self.reference_velocity * self.reference_length / self.fluid.reynolds

    @property
    def gravity_vector(self) -> np.ndarray:
        """Gravitational acceleration (gdim,), zero without gravity."""
        felt = None if self.effects.gravity is False else self.gravity
        return (felt.acceleration if felt else 0.0) * self.gravity_direction

    @property
    def gravity_direction(self) -> np.ndarray:
        """Unit vector (gdim,) of gravity, turned by the slope of the bed."""
        slope = self.bed.slope_angle if self.bed else 0.0
        direction = np.zeros(self.gdim)
        direction[0], direction[self.up] = math.sin(slope), -math.cos(slope)
        return direction

    @property
    def contact_gap(self) -> float:
        """Gap [length] that represents contact in the flow; zero without a grain."""
        return 0.0 if self.grain is None else (self.contact or NO_CONTACT).gap * self.grain.size

    @property
    def contact_tolerance(self) -> float:
        """Distance [length] that counts as contact; zero without a grain."""
        tolerance = (self.contact or NO_CONTACT).tolerance
        return 0.0 if self.grain is None else tolerance * self.grain.size


def register(section: type[Section]) -> None:
    """Add a kind of grain, bed or flow to scenes (docs/contribute/adding.md).

    Raises SceneError if its `shape` (grain) or `kind` is not a single, new value.
    """
    name = discriminator(section)
    flows = issubclass(section, FlowSection)
    field = Scene.model_fields["flow" if flows else "body" if name == "shape" else "bed"]
    known = variants(field.annotation)
    if tag(section) in (None, *map(tag, known)):
        why = f"{section.__name__}: shape or kind is missing, or used by another section"
        raise SceneError(f'{why}; give a key as in shape: Literal["stadium"]')
    kinds: Any = Annotated[Union[(*known, section)], Field(discriminator=name)]
    field.annotation = kinds if flows else kinds | None
    Scene.model_rebuild(force=True)


# -- mirror image ----------------------------------------------------------------------------------


def _fields(scene: Scene) -> Iterator[Compared]:
    domain, flow = scene.domain, scene.flow
    grain, placement, unchanged = scene.grain, scene.placement, np.ones(1)
    if placement is not None:
        surface = grain.surface(0.1 * grain.size).points
        points = placement.to_scene(np.vstack([np.zeros(3), surface]))
        # Some 200 points suffice to exclude most scanned grains.
        for some in (points[:: 1 + len(points) // 200], points):
            yield "grain", lambda x: grain.level(placement.to_body(x)), unchanged, some
    # Bedforms and formulas may have the grid's period, but not that of points at random.
    low, high = np.transpose([*domain.spans, (domain.bottom, domain.ceiling)])
    scattered = np.random.default_rng(0).uniform(low, high, (SAMPLES, 3))
    points = np.vstack([domain.grid(11, 11, 11), scattered])
    yield "bed", scene.bed_height, unchanged, points
    if isinstance(flow, ExpressionFlow):
        formulas = expressions(flow.components, "flow.components")

        def velocity(x: Floats) -> Any:
            times = np.linspace(0.0, scene.time.end if scene.time else 0.0, len(x))
            return [component(x.T, times) for component in formulas]

        yield "flow", velocity, MIRRORED, points
    if scene.surface is not None:
        formula = Expression(scene.surface.elevation, "surface.elevation")
        yield "free surface", lambda x: formula(x.T), unchanged, points


def _is_turned_over(scene: Any) -> bool:
    """Whether a grain leaves the plane at mid-width, or turns about an axis in it."""
    body, time = scene.body, scene.time
    if body.course is not None:
        instants = np.arange(0.0, time.end, 0.1 * time.step)
        points = np.zeros((3, len(instants)))
        across = expressions(body.course[1::2], "body.course")
        return any(formula(points, instants).any() for formula in across)
    rotation = scene.placement.rotation
    inertia = rotation @ inertia_tensor(body) @ rotation.T
    # Products of inertia with the normal y turn a spin about it into one about x and z.
    products = float(np.abs(inertia[1, [0, 2]]).max())
    return any([body.velocity[1], *body.spin[::2]]) or products > ALIKE * float(np.trace(inertia))
