"""What a user asks for: the sections of a scene, as data that has been checked.

Scene units: lengths and velocities as written in the scene, fluid density 1. The kinematic viscosity follows
from the Reynolds number. A scene is built here from Python, or read from TOML by `incipient.scene.file`;
either way it is complete and free of contradictions once it exists.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from .checks import contradictions
from .effects import Effects, section_of
from .flows import ExpressionFlow, Flow, Lid, OpenChannel, Poiseuille, Shear, Still, Uniform
from .kinds import Bed, Body
from .messages import counted, refusal
from .motion import mass, mean_density
from .section import SMALLEST, NotNegative, Positive, Section, contradiction
from .shapes import (
    Disc,
    Discs,
    Ellipse,
    Flat,
    HalfDiscs,
    Inclined,
    Polygon,
    Polyline,
    Rectangle,
    Sinusoidal,
    Star,
    Superellipse,
)
from .solids import Box, Ellipsoid, Mesh, Polyhedron, Sphere, Spheres, Superquadric
from .terrains import HeightMapBed, MeshBed, RidgeBed, SphereBed

if TYPE_CHECKING:
    import numpy as np

    from ..geometry.placement import Placement

__all__ = [
    "Bed",
    "Body",
    "Box",
    "Contact",
    "Disc",
    "Discs",
    "Domain",
    "Effects",
    "Ellipse",
    "Ellipsoid",
    "ExpressionFlow",
    "Flat",
    "Flow",
    "Fluid",
    "Gravity",
    "HalfDiscs",
    "HeightMapBed",
    "Inclined",
    "Lid",
    "Mesh",
    "MeshBed",
    "Numerics",
    "OpenChannel",
    "Output",
    "Poiseuille",
    "Polygon",
    "Polyhedron",
    "Polyline",
    "Rectangle",
    "RidgeBed",
    "Scene",
    "Shear",
    "Sinusoidal",
    "Sphere",
    "SphereBed",
    "Spheres",
    "Star",
    "Still",
    "Superellipse",
    "Superquadric",
    "Time",
    "Uniform",
]

Accuracy = float | Literal["verdict"]
Tolerance = float | Literal["auto"]
Top = Literal["auto", "wall", "slip", "stream"]
Sides = Literal["slip", "stream", "wall"]
Symmetry = Literal["auto", True, False]
Corner = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]

_TOPS: dict[str, Top] = {
    "shear": "stream",
    "uniform": "stream",
    "expression": "stream",
    "poiseuille": "wall",
    "open-channel": "slip",
    "lid": "wall",
    "still": "wall",
}
# Below this the curved cells' geometry errs as much, which no estimate sees (docs/accuracy.md).
FINEST = 1e-5
_DEFAULT_GAP = 0.01
# Gaps [grain sizes]: above the first the plan warns, above the second the flow is no more that around a grain at rest.
WIDE_GAP, WIDEST_GAP = 0.03, 0.1
_DEFAULT_TOLERANCE = 1e-6


class Domain(Section):
    """The region the fluid may fill."""

    kind: Literal["channel", "box"] = Field(
        "channel", description="Channel: inflow left, open outflow right; box: closed"
    )
    length: Positive = Field(description="Extent along the stream [length]")
    height: Positive = Field(description="Extent from the lower side to the top [length]")
    width: Positive | None = Field(
        None,
        description="Extent across, which makes the scene three-dimensional, z upwards [length]",
        examples=[20.0],
    )
    origin: Corner = Field(
        (0.0, 0.0),
        validate_default=True,
        description="Lower left corner [length]; the bed's base line runs through it",
    )
    top: Top = Field("auto", description="Upper side; auto: what suits the flow; stream: as the flow")
    sides: Sides | None = Field(
        None,
        description="Both sides across the width, with width; stream: as the flow; by default slip, of a box wall",
        examples=["slip"],
    )
    symmetric: Symmetry | None = Field(
        None,
        description="With width: true computes half of a scene that is its own mirror image; by default found out",
        examples=["auto"],
    )

    @field_validator("origin", mode="before")
    @classmethod
    def _has_as_many_components(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, list | tuple):
            return value
        in_space = info.data.get("width") is not None
        if in_space and tuple(value) == (0.0, 0.0):
            return (0.0, 0.0, 0.0)
        if len(value) != (3 if in_space else 2):
            remedy = "give three, as in [x, y, z]" if in_space else "give two, as in [x, y]"
            raise contradiction(f"has {counted(len(value), 'item')}", remedy)
        return value

    @field_validator("symmetric", mode="before")
    @classmethod
    def _is_a_choice(cls, value: Any) -> Any:
        if value is None or value == "auto" or isinstance(value, bool):
            return value
        raise contradiction(f"is {value!r}".replace("'", '"'), 'use "auto", true or false')

    @field_validator("sides", "symmetric")
    @classmethod
    def _goes_with_width(cls, value: Any, info: ValidationInfo) -> Any:
        if value is not None and info.data.get("width") is None and "width" in info.data:
            raise contradiction("goes with width, which is not given", "add domain.width or leave it out")
        return value

    @field_validator("top", mode="before")
    @classmethod
    def _no_free_surface(cls, value: Any, info: ValidationInfo) -> Any:
        if value not in ("free-surface", "free surface", "free_surface"):
            return value
        if info.data.get("kind") == "box":
            raise contradiction(
                "a closed box has no free surface", 'use "wall" or kind = "channel" with top = "slip"'
            )
        raise contradiction("a free surface is not simulated by this version", 'use "slip"')

    @property
    def left(self) -> float:
        """Abscissa of the inflow, or of the left wall."""
        return self.origin[0]

    @property
    def right(self) -> float:
        """Abscissa of the outflow, or of the right wall."""
        return self.origin[0] + self.length

    @property
    def bottom(self) -> float:
        """Height of the lower side, which is the bed's base line."""
        return self.origin[-1]

    @property
    def ceiling(self) -> float:
        """Height of the top."""
        return self.origin[-1] + self.height

    @property
    def across(self) -> tuple[float, float]:
        """The least and the largest y of a domain in space."""
        assert self.width is not None
        return self.origin[1], self.origin[1] + self.width

    @property
    def middle(self) -> float:
        """y of the vertical plane through the middle of a domain in space."""
        return 0.5 * sum(self.across)

    @property
    def extents(self) -> tuple[float, ...]:
        """Length, in space width, and height."""
        return (self.length, *((self.width,) if self.width is not None else ()), self.height)


class Fluid(Section):
    """The fluid, of density 1."""

    reynolds: Positive = Field(description="Reynolds number V L / nu; V is the flow's velocity [-]")
    scale: Literal["grain", "flow"] = Field(
        description="L is the largest diameter of the grain, or the height of the domain"
    )
    inertia: bool = Field(True, description="false: Stokes flow, without convection; true: see [effects]")


class Gravity(Section):
    """Gravity, downwards; turned by the slope of an inclined bed."""

    acceleration: NotNegative = Field(description="Gravitational acceleration [length/time^2]")


class Contact(Section):
    """The contact of grain and bed."""

    friction: NotNegative = Field(description="Coefficient of static friction [-]")
    gap: Positive = Field(
        _DEFAULT_GAP,
        description="Gap that stands for contact while the flow is computed, 0.1 at most [grain sizes]",
    )
    tolerance: Positive = Field(
        _DEFAULT_TOLERANCE, description="Distance that counts as touching [grain sizes]"
    )

    @field_validator("gap")
    @classmethod
    def _is_narrow(cls, gap: float) -> float:
        if gap > WIDEST_GAP:
            why = f"is {gap:g}: so far from the bed the flow pushes otherwise than on a grain that touches it"
            raise contradiction(why, f"give at most {WIDEST_GAP:g}, better {WIDE_GAP:g} or less")
        return gap


class Time(Section):
    """Time dependence; without this section the flow is steady."""

    end: Positive = Field(description="Time at which to stop [time]", examples=[10.0])
    step: Positive = Field(description="Time step, the first one if adaptive [time]", examples=[0.05])
    first_step: Positive = Field(
        1.0,
        le=1.0,
        description="Length of the first step over `step`, the next are each a quarter longer [-]",
    )
    scheme: Literal["bdf1", "bdf2"] = Field(
        "bdf2", description="Backward differences of first or second order"
    )
    start: Literal["rest", "stokes", "steady"] = Field("rest", description="Flow at time 0")
    tolerance: Positive | None = Field(
        None, description="Relative error of a step; given, the step adapts to it [-]", examples=[1e-4]
    )

    @model_validator(mode="after")
    def _has_a_step(self) -> Time:
        if self.step > self.end:
            raise self.refused(
                "step", f"is {self.step:g} but time ends at {self.end:g}", "reduce step or enlarge end"
            )
        if self.first_step < 1.0 and self.tolerance is not None:
            raise self.refused(
                "first_step",
                "is for steps of a fixed length",
                "leave it out: with tolerance the first steps are short",
            )
        return self


class Numerics(Section):
    """How the equations are solved; every key may be left out."""

    order: int = Field(2, ge=2, le=4, description="Order of the velocity, 2 to 4; the pressure's is one less")
    geometry_order: int | None = Field(
        None, ge=1, le=3, description="Order of curved cells, 1 to 3; without it: chosen", examples=[2]
    )
    mesh_size: float = Field(
        1.0, ge=0.01, le=100.0, description="Factor on the size of all cells; 0.5 halves them [-]"
    )
    max_cells: int = Field(
        1_000_000, ge=1, description="Triangles expected of a mesh above which it is not made"
    )
    convection: Literal["implicit", "extrapolated"] = Field(
        "implicit", description="Convection by Newton iteration, or linearised about earlier steps"
    )
    form: Literal["printed", "energy-stable"] = Field(
        "printed", description="Convective term as in the paper, or such that it cannot create energy"
    )
    stabilisation: Literal["auto", "on", "off"] = Field(
        "auto", description="Stabilised convection on coarse cells; auto: where their Reynolds number asks it"
    )
    coupling: Literal["exact", "naive"] = Field(
        "exact",
        description="Coupling of fluid and moving grain; naive: for comparison only, diverges for light grains",
    )
    error_bars: bool = Field(
        True, description="Estimate errors of force, couple and safety factor; takes about as long as the run"
    )
    accuracy: Accuracy | None = Field(
        None,
        description='Relative error wanted, or "verdict": until that is decided; mesh and order are then chosen',
        examples=[0.01],
    )
    accuracy_of: Literal["force", "couple", "safety factor"] = Field(
        "force", description="The quantity whose relative error `accuracy` limits"
    )
    accuracy_includes: Literal["discretisation", "all"] = Field(
        "discretisation",
        description="Errors that it is to include; all: gap and domain as well, which the run then chooses",
    )
    budget_seconds: Positive | None = Field(
        None, description="Wall time after which to stop seeking accuracy [s]", examples=[60.0]
    )
    budget_mib: Positive | None = Field(
        None, description="Memory beyond which not to seek accuracy [MiB]", examples=[2000.0]
    )
    interface_tolerance: Tolerance = Field(
        "auto",
        description="Error of a moving grain's equation of motion relative to its load; auto: as tolerance [-]",
    )
    remesh_below: float = Field(
        0.35,
        gt=0,
        lt=1,
        description="Quality of the worst cell, relative to when made, that calls for a new mesh",
    )
    tolerance: Tolerance = Field(
        "auto",
        description="Error that iterations may leave, relative; auto: steady 1e-6, in time 0.1 of a step's own [-]",
    )
    max_iterations: int = Field(25, ge=1, description="Newton iterations after which to give up")

    @field_validator("tolerance", "interface_tolerance", mode="before")
    @classmethod
    def _is_a_tolerance(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value == "auto" or (number and value >= SMALLEST):
            return value
        shown = f'"{value}"' if isinstance(value, str) else value
        raise contradiction(f"is {shown}", 'give a number above 0 such as 1e-8, or "auto"')

    @field_validator("accuracy", mode="before")
    @classmethod
    def _is_an_accuracy(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is None or value == "verdict" or (number and FINEST <= value < 1.0):
            return value
        shown = f'"{value}"' if isinstance(value, str) else value
        raise contradiction(
            f"is {shown}", f'give a relative error such as 0.01, from {FINEST:g} to below 1, or "verdict"'
        )


class Output(Section):
    """What is written besides the result."""

    fields: bool = Field(True, description="Write velocity, pressure and tractions for ParaView")
    pictures: bool = Field(False, description="Draw pictures")
    every: int = Field(0, ge=0, description="Write fields every so many time steps; 0: the last only")
    checkpoint: int = Field(
        0,
        ge=0,
        description="Save all that a run needs to go on every so many steps; 0: only if it is cut short or at contact",
    )


class Scene(Section):
    """A complete scene.

    Raises:
        SceneError: one line that names the key, why and the remedy.
    """

    title: str = Field("", description="What this scene is about")
    domain: Domain = Field(description="The region the fluid may fill")
    fluid: Fluid = Field(description="The fluid, of density 1")
    flow: Flow = Field(description="What drives the fluid")
    body: Body | None = Field(None, description="The grain")
    bed: Bed | None = Field(None, description="The bed, in place of the domain's lower side")
    gravity: Gravity | None = Field(
        None, description="Gravity, downwards, turned by the slope of an inclined bed"
    )
    contact: Contact | None = Field(None, description="The contact of grain and bed")
    time: Time | None = Field(None, description="Time dependence; without this section the flow is steady")
    effects: Annotated[Effects, BeforeValidator(section_of)] = Field(
        Effects(), description="What to simulate; auto: decided from the scene and its dimensionless numbers"
    )
    numerics: Numerics = Field(Numerics(), description="How the equations are solved")
    output: Output = Field(Output(), description="What is written besides the result")

    @model_validator(mode="after")
    def _free_of_contradictions(self) -> Scene:
        found = contradictions(self)
        if found:
            raise refusal("Scene", found, between=True)
        return self

    @property
    def gdim(self) -> int:
        """Dimension of space: three where the domain has a width."""
        return 2 if self.domain.width is None else 3

    @property
    def up(self) -> int:
        """Number of the coordinate in which heights over the bed are counted, the last one."""
        return self.gdim - 1

    @property
    def top(self) -> Top:
        """The upper boundary: what the scene says, or for "auto" what suits the flow."""
        return _TOPS[self.flow.kind] if self.domain.top == "auto" else self.domain.top

    @property
    def sides(self) -> Sides:
        """Both sides across the width of a scene in space."""
        return self.domain.sides or ("wall" if self.domain.kind == "box" else "slip")

    @cached_property
    def symmetric(self) -> bool:
        """Whether half of the scene is computed: what lies at one side of the middle of a domain in space.

        Raises SceneError if the scene is said to be its own mirror image and is not.
        """
        from .symmetry import is_halved

        return is_halved(self)

    @cached_property
    def grain(self) -> Any:
        """The grain's shape in its body frame, a Grain of the plane or a Solid; None without a grain."""
        return None if self.body is None else self.body.grain()

    @property
    def mass(self) -> float | None:
        """Mass of the grain per unit depth (fluid density one), None where neither it nor a density is given."""
        return None if self.body is None else mass(self.body)

    @property
    def density(self) -> float | None:
        """Mass of the grain over its area, relative to the fluid's density; None where `mass` is."""
        return None if self.body is None else mean_density(self.body)

    @property
    def rests(self) -> bool:
        """Whether there is a grain that rests on the bed."""
        return self.body is not None and self.bed is not None and self.body.x is not None

    @cached_property
    def bed_shape(self) -> Any:
        """The bed's shape, a Bed of the plane or a Terrain; None without a bed."""
        if self.bed is None:
            return None
        made = self.bed.surface if self.gdim == 2 else self.bed.terrain
        return made(self.domain.bottom)

    @property
    def datum(self) -> float:
        """The height y at which the profile of the undisturbed flow starts; the same over the whole bed."""
        domain, bed = self.domain, self.bed_shape
        if bed is None:
            return domain.bottom
        level = getattr(self.flow, "datum", "crest")
        within: tuple[Any, ...] = (domain.left, domain.right)
        if self.gdim == 3:
            within = within, domain.across
        if level == "crest":
            return float(bed.crest_level(*within))
        return float(bed.mean(*within)) if level == "mean" else domain.bottom + float(level)

    @cached_property  # it is asked for at every step and takes longer than a step's solution
    def placement(self) -> Placement | None:
        """Where the grain is: lowered onto the bed until it touches, or held at its centre; without a gap.

        With body.settle it then rolls and tips until it rests. Raises SceneError if it does not.
        """
        import numpy as np

        from ..geometry.rest import rest
        from .settling import rested

        body = self.body
        if body is None:
            return None
        if body.centre is not None:
            return body.placed(body.centre)
        if body.x is None or self.bed is None:
            return None
        # From the domain's corner: far from the origin numbers are too far apart for a grain that settles.
        corner, over = self.domain.origin, [body.x]
        if self.gdim == 2:
            bed: Any = self.bed.surface(0.0, corner[0])
        else:
            bed = self.bed.terrain(0.0, corner[:2])
            over.append(self.domain.middle if body.aside is None else body.aside)
        start = body.placed([*np.subtract(over, corner[:-1]), 0.0])
        if body.settle:
            down, friction = tuple(self.gravity_direction), self.contact.friction if self.contact else None
            found = rested(body.grain(), bed, start, down, friction, self.domain.length)
        else:
            turned: Any = start.angle if start.quaternion is None else start.quaternion
            found = rest(body.grain(), bed, start.centre[0] if self.gdim == 2 else start.centre[:2], turned)
        return found.moved(corner, np.zeros(2 * self.gdim - 3))

    @property
    def reference_length(self) -> float:
        """L of the Reynolds number: the grain's largest diameter or the height of the domain."""
        grain = self.grain if self.fluid.scale == "grain" else None
        return self.domain.height if grain is None else grain.size

    @property
    def reference_velocity(self) -> float:
        """V of the Reynolds number: of shear rate times L, else the velocity that the flow states."""
        return self.flow.rate * self.reference_length if isinstance(self.flow, Shear) else self.flow.velocity

    @property
    def viscosity(self) -> float:
        """Kinematic viscosity nu = V L / Re in scene units."""
        return self.reference_velocity * self.reference_length / self.fluid.reynolds

    @property
    def gravity_vector(self) -> np.ndarray:
        """Gravitational acceleration (gdim,) in the scene's coordinates, zero where there is none or it is left out."""
        felt = self.gravity is not None and self.effects.gravity is not False
        acceleration = self.gravity.acceleration if felt and self.gravity else 0.0
        return acceleration * self.gravity_direction

    @property
    def gravity_direction(self) -> np.ndarray:
        """The unit vector (gdim,) of gravity in the scene's coordinates, turned by the slope of the bed."""
        import numpy as np

        slope = self.bed.slope_angle if self.bed else 0.0
        direction = np.zeros(self.gdim)
        direction[0], direction[self.up] = math.sin(slope), -math.cos(slope)
        return direction

    @property
    def contact_gap(self) -> float:
        """The gap [length] that stands for contact while the flow is computed; zero without a grain."""
        return self._of_grain_size(self.contact.gap if self.contact else _DEFAULT_GAP)

    @property
    def contact_tolerance(self) -> float:
        """The distance [length] that counts as touching; zero without a grain."""
        return self._of_grain_size(self.contact.tolerance if self.contact else _DEFAULT_TOLERANCE)

    def _of_grain_size(self, fraction: float) -> float:
        grain = self.grain
        return 0.0 if grain is None else fraction * grain.size
