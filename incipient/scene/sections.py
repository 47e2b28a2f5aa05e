"""The sections of a scene but those that have kinds, [gusts] and [units].

Lengths and velocities are in scene units, the fluid's density is 1, its viscosity follows from the Reynolds number.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from ..arrays import Floats
from .expression import Expression
from .section import (
    Choice,
    FromFile,
    NotNegative,
    Pair,
    Pairs,
    Positive,
    Rule,
    Section,
    file_key,
    formula,
    key,
    rises,
)

if TYPE_CHECKING:
    from ..contact.friction import FrictionCone

Top = Literal["auto", "wall", "slip", "stream", "free-surface"]
Sides = Literal["slip", "stream", "wall"]
Corner = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]
ORDERS = (2, 3, 4)
MESH_SIZES = (0.01, 100.0)  # range of mesh_size

# Quantities of a free surface: elevations in the course of the run, and at its end.
OF_SURFACE = ("elevation", "level")
OF_GRAIN = "velocity"
# The quantity of the walls of a turbulent flow: u* at the outflow, or its mean if the bed is not planar.
OF_WALLS = "shear velocity"
# Below this the curved cells' geometry errs as much, which no estimate includes (docs/contribute/defaults.md).
FINEST = 1e-5
Accuracy = Annotated[float, Field(ge=FINEST, lt=1)] | Literal["verdict"] | None
Tolerance = Positive | Literal["auto"]
FREE = "free-surface"
Row = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]
OF_INFLOW = ("intensity", "length")
OF_K_EPSILON = ("c_mu", "c_1", "c_2", "sigma_k", "sigma_epsilon")
# Gaps [grain sizes]: above the first the plan warns, above the second the flow is not that around a grain at rest.
WIDE_GAP, WIDEST_GAP = 0.03, 0.1


class Domain(Section):
    """The region that the fluid may fill."""

    rules = (
        Rule("{v}", lambda s: [k for k in ("sides", "symmetric") if s.width is None and getattr(s, k) is not None],
             "needs width, which is not given", "add domain.width or leave it out"),
        Rule("origin", lambda s: len(s.origin) < s.gdim, "has 2 items", "give three, as in [x, y, z]"),
        Rule("origin", lambda s: len(s.origin) > s.gdim, "has 3 items", "give two, as in [x, y]"),
    )  # fmt: skip

    kind: Literal["channel", "box"] = key(
        "Channel: inflow left, open outflow right; box: closed", "channel"
    )
    length: Positive = key("Extent along the flow [length]")
    height: Positive = key("Extent from the lower side to the top [length]")
    width: Positive | None = key(
        "Width of a 3-D scene, with z upwards [length]",
        None,
        examples=[20.0],
    )
    origin: Corner = key(
        "Lower left corner [length]; the bed's base line runs through it",
        (0.0, 0.0),
        validate_default=True,
    )
    top: Top = key(
        "Top; auto: from flow.kind; stream: moves with the base flow; free-surface: see [surface]",
        "auto",
    )
    sides: Sides | None = key(
        "Lateral boundaries; stream: move with the base flow; default: slip, of a box wall",
        None,
        examples=["slip"],
    )
    symmetric: Choice | None = key(
        "In 3-D: true computes half of a symmetric scene; default: if it is symmetric",
        None,
        examples=["auto"],
    )

    @field_validator("origin")
    @classmethod
    def _in_space(cls, value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        return (*value, 0.0) if info.data.get("width") and value == (0.0, 0.0) else value

    @property
    def gdim(self) -> int:
        return 2 if self.width is None else 3

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        along = (self.left, self.right)
        return (along,) if self.width is None else (along, self.across)

    @property
    def left(self) -> float:
        return self.origin[0]

    @property
    def right(self) -> float:
        return self.origin[0] + self.length

    @property
    def bottom(self) -> float:
        return self.origin[-1]

    @property
    def ceiling(self) -> float:
        return self.origin[-1] + self.height

    @property
    def across(self) -> tuple[float, float]:
        assert self.width is not None
        return self.origin[1], self.origin[1] + self.width

    def grid(self, *counts: int) -> Floats:
        """Equidistant points (n, k) of the whole domain, with k counts along the flow, across and in height."""
        sides = (*self.spans, (self.bottom, self.ceiling))
        axes = [np.linspace(*ends, count) for ends, count in zip(sides, counts, strict=False)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    @property
    def middle(self) -> float:
        return 0.5 * sum(self.across)

    @property
    def entrance(self) -> tuple[float, ...]:
        return (self.left, *((self.middle,) if self.width is not None else ()), self.bottom)

    @property
    def sizes(self) -> dict[str, float]:
        """Extents by key, in the order of the coordinates."""
        across = {} if self.width is None else {"width": self.width}
        return {"length": self.length, **across, "height": self.height}


class Fluid(Section):
    """The fluid, of density 1."""

    reynolds: Positive = key("Reynolds number V L / nu; V is the flow's velocity [-]", None)
    scale: Literal["grain", "flow"] = key(
        "L is the largest diameter of the grain, or the height of the domain"
    )
    inertia: bool = key("false: Stokes flow, without convection; true: see [effects]", True)


class Gravity(Section):
    """Gravity, downwards; turned by the slope of an inclined bed."""

    acceleration: NotNegative = key("Gravitational acceleration [length/time^2]", None)


class Contact(Section):
    """The contact of grain and bed."""

    friction: NotNegative = key("Coefficient of static friction [-]")
    cohesion: NotNegative = key(
        "Largest tensile force of each contact (coplanar points are one), added to the normal force in the friction "
        "bound [force]",
        0.0,
    )
    gap: Positive = key(
        "Gap that represents contact in the flow, 0.1 at most; in turbulent 2-D flow past a fixed grain the "
        "width up to which the space next to contacts is closed [grain sizes]",
        0.01,
        le=WIDEST_GAP,
    )
    tolerance: Positive = key("Distance that counts as contact [grain sizes]", 1e-6, le=WIDEST_GAP)
    kinetic_friction: NotNegative | None = key(
        "Coefficient of kinetic friction; default: that of static friction [-]",
        None,
    )
    restitution: NotNegative = key("Coefficient of normal restitution of impacts [-]", 0.0, le=1.0)
    rolling_resistance: NotNegative = key(
        "Largest torque against rolling, over the normal force and half of the grain's size [-]",
        0.0,
    )

    @property
    def law(self) -> FrictionCone:
        from ..contact.friction import FrictionCone

        return FrictionCone.of(self.friction, self.cohesion)


class Time(Section):
    """Time dependence; without this section the flow is steady."""

    rules = (
        Rule("step", lambda s: s.step > s.end,
             "is {s.step:g} but time ends at {s.end:g}", "reduce step or enlarge end"),
        Rule("first_step", lambda s: s.first_step < 1.0 and s.tolerance is not None,
             "is for steps of a fixed length", "leave it out: with tolerance the first steps are short"),
    )  # fmt: skip

    end: Positive = key("End time [time]", examples=[10.0])
    step: Positive = key("Time step, the first one if adaptive [time]", examples=[0.05])
    first_step: Positive = key(
        "First step over `step`; the next ones grow by a quarter each [-]", 1.0, le=1.0
    )
    scheme: Literal["bdf1", "bdf2"] = key("Backward differences of first or second order", "bdf2")
    start: Literal["rest", "stokes", "steady"] = key("Flow at time 0", "rest")
    tolerance: Positive | None = key(
        "Relative error of a step, for adaptive steps [-]", None, examples=[1e-4]
    )
    until: Literal["end", "out-of-pocket", "at-rest"] = key(
        "Event that ends the run before `end`: the grain has left its pocket, or rests again", "end"
    )
    until_steady: Positive | None = key(
        "Relative rate of change of the flow at which the run ends before `end` [1/time]",
        None,
        examples=[1e-5],
    )


class Output(Section):
    """Additional output."""

    fields: bool = key("Write velocity, pressure and tractions for ParaView", True)
    pictures: bool = key("Draw pictures", False)
    every: int = key("Write fields every so many time steps; 0: the last only", 0, ge=0)
    checkpoint: int = key(
        "Save a checkpoint every so many steps; 0: only if the run is interrupted or at contact",
        0,
        ge=0,
    )


class Effects(Section):
    """Effects to simulate; by default chosen from the scene and its dimensionless numbers."""

    inertia: Choice = key("Convection; auto: if it matters at the requested accuracy", "auto")
    unsteadiness: Choice = key("Rate of change; false with [time]: quasi-steady flow", "auto")
    gravity: Choice = key("Weight and buoyancy; auto: with [gravity]", "auto")
    contact: Choice = key("Contact forces and verdict; auto: if a grain rests on a bed", "auto")
    turbulence: Choice = key(
        "The model of [turbulence]; auto: none; the plan warns of flows that may be turbulent",
        "auto",
    )


class Wave(Section):
    """Second-order Stokes wave that enters a channel with the base flow."""

    amplitude: Positive = key(
        "Amplitude of the first harmonic of the elevation, half of the wave's height [length]",
        examples=[0.01],
    )
    period: Positive = key("Period in the frame of the bed [time]", examples=[5.0])


class Surface(FromFile):
    """The free surface, at the top of the domain if at rest."""

    may_be_absent = True
    rules = (
        Rule("points", lambda s: s.points and s.elevation != "0",
             "are given with a formula for the elevation", "leave one of them out"),
        Rule("points", lambda s: len(s.points) == 1 or not rises(s.points),
             "do not increase in x", "give two or more points sorted by x, each x once"),
    )  # fmt: skip

    elevation: Annotated[str, formula("xy")] = key(
        "Formula in x, in 3-D also y: height above the still level [length]", "0"
    )
    file: str | None = file_key("CSV file of x, elevation", "points", "elevation.csv")
    points: Pairs = key(
        "In 2-D, instead of the formula: x and elevation, linear in between [length]", ()
    )
    stations: Annotated[tuple[float | Pair, ...], Field(strict=False)] = key(
        "Positions x, in 3-D [x, y], of elevations in the history; default: a few",
        (),
    )
    bottom: Literal["no-slip", "slip"] = key("Level bottom, without [bed]", "no-slip")
    wave: Wave | None = key(
        "Wave that enters with the base flow",
        None,
        examples=[{"amplitude": 0.01, "period": 5.0}],
    )
    outflow: Literal["open", "wall"] = key(
        "Right end of a channel; open: still level beyond it; wall: closed", "open"
    )
    sponge: NotNegative = key(
        "Length of the sponge layer at the right end of a channel [length]", 0.0
    )

    @property
    def given(self) -> str:
        """The key of the elevation."""
        return "points" if self.points else "elevation"

    def height(self, x: np.ndarray) -> np.ndarray:
        if self.points:
            return np.interp(x[0], *np.transpose(self.points))
        return Expression(self.elevation)(x)

    def places(self) -> list[tuple[float, ...]]:
        return [station if isinstance(station, tuple) else (station,) for station in self.stations]


def stations_of(surface: Surface | None, domain: Domain) -> list[tuple[float, ...]]:
    """Positions of reported elevations; by default five from end to end, in 3-D three by three."""
    stations = () if surface is None else surface.places()
    along = 5 if domain.gdim == 2 else 3
    evenly = (
        [low + (high - low) * i / (along - 1) for i in range(along)] for low, high in domain.spans
    )
    return list(stations) or list(product(*evenly))


class Turbulence(Section):
    """The turbulence model, with effects.turbulence = true."""

    rules = (
        Rule("roughness", lambda s: s.wall == "rough" and not s.roughness,
             'is 0 but wall is "rough"', "give the equivalent sand roughness"),
        Rule("roughness", lambda s: s.wall != "rough" and s.roughness,
             'is {s.roughness:g} but wall is "{s.wall}"', 'set wall = "rough"'),
        Rule("upstream_roughness", lambda s: s.upstream_roughness and s.roughness,
             'is for smooth walls, but wall is "rough"', "leave it out: the inflow developed over these walls"),
        Rule("upstream_roughness", lambda s: s.upstream_roughness and s.inflow == "given",
             'is not read with inflow = "given"', "leave it out"),
        Rule("{v}", lambda s: [k for k in OF_INFLOW if s.inflow == "developed" and getattr(s, k) is not None],
             'is read only with inflow = "given" or "profile"', "leave it out"),
        Rule("{v}", lambda s: [k for k in OF_INFLOW if s.inflow != "developed" and getattr(s, k) is None],
             'is missing, which inflow = "{s.inflow}" needs', "add it"),
        Rule("profile", lambda s: s.profile and s.inflow != "profile",
             'is read only with inflow = "profile"', "leave it out"),
        Rule("profile", lambda s: s.inflow == "profile" and (len(s.profile) < 2 or len(set(map(len, s.profile))) != 1),
             "does not have two or more rows of one length", "give rows of height and speed, each with k or none"),
        Rule("profile", lambda s: s.profile and not rises(((0.0,), *s.profile)),
             "has heights that do not increase from above zero", "sort the rows by height, without walls"),
        Rule("profile", lambda s: any(value <= 0.0 for row in s.profile for value in row[1:]),
             "has a speed or a k that is not positive", "omit walls: the law of the wall holds there"),
        Rule("{v}", lambda s: [k for k in OF_K_EPSILON if s.model != "k-epsilon" and s.changed(k)],
             'is not read by model = "k-omega-sst"', "leave it out"),
        Rule("c_2", lambda s: not 1.0 < s.c_1 < s.c_2,
             "is {s.c_2:g}", "give 1 < c_1 < c_2: else turbulence does not decay"),
    )  # fmt: skip

    model: Literal["k-epsilon", "k-omega-sst"] = key("Model: k-epsilon or k-omega SST", "k-epsilon")
    wall: Literal["equilibrium", "rough"] = key("Law of the wall", "equilibrium")
    roughness: NotNegative = key(
        'Equivalent sand roughness of walls that are "rough"; a grain is smooth [length]',
        0.0,
    )
    upstream_roughness: NotNegative = key(
        "Equivalent sand roughness of the bed upstream, over which the inflow past smooth walls developed [length]",
        0.0,
    )
    wall_distance: Positive | None = key(
        "Distance of walls from the mesh; without it 50 nu/u* with k-epsilon, 0.45 nu/u* with k-omega-sst [length]",
        None,
        examples=[0.05],
    )
    inflow: Literal["developed", "given", "profile"] = key(
        "Inflow: developed; uniform, with intensity and length; or a measured profile",
        "developed",
    )
    intensity: Positive | None = key(
        "Turbulence intensity relative to V; with a profile its lower bound [-]",
        None,
        examples=[0.05],
    )
    length: Positive | None = key(
        "Mixing length of the inflow; with a profile its upper bound [length]",
        None,
        examples=[0.1],
    )
    profile: Annotated[tuple[Row, ...], Field(strict=False)] = key(
        "Rows of height above the bed at the inflow [length] and speed over V, and k over V^2 if known",
        (),
        examples=[[[0.1, 0.7], [0.5, 0.85], [1.5, 1.0]]],
    )
    c_mu: Positive = key("nu_t = c_mu k^2/epsilon [-]", 0.09)
    c_1: Positive = key("Production of epsilon [-]", 1.44)
    c_2: Positive = key("Loss of epsilon [-]", 1.92)
    sigma_k: Positive = key("nu_t over the diffusivity of k [-]", 1.0)
    sigma_epsilon: Positive = key("nu_t over the diffusivity of epsilon [-]", 1.3)


class Numerics(Section):
    """How the equations are solved; every key is optional."""

    order: Literal["auto", 2, 3, 4] = key(
        "Order of the velocity, the pressure's less one; "
        "auto: 3 if nothing moves, in 3-D in creeping flow, otherwise 2",
        "auto",
    )
    geometry_order: int | None = key(
        "Order of curved cells, 1 to 3; default: chosen", None, ge=1, le=3, examples=[2]
    )
    mesh_size: float = key(
        "Factor on the size of all cells; 0.5 halves them [-]",
        1.0,
        ge=MESH_SIZES[0],
        le=MESH_SIZES[1],
    )
    max_cells: int = key("Largest expected number of triangles of a mesh", 1_000_000, ge=1)
    convection: Literal["implicit", "extrapolated"] = key(
        "Convection by Newton iteration, or linearised about earlier steps", "implicit"
    )
    stabilisation: Literal["auto", "on", "off"] = key(
        "Stabilised convection on coarse cells; auto: where the cell Reynolds number requires it",
        "auto",
    )
    meshed_bed: Positive = key(
        "Factor on the radius about the grain within which the forms of a 3-D bed are meshed [-]",
        1.0,
    )
    error_bars: bool = key(
        "Estimate errors of force, torque, safety factor, path, elevations and, with turbulence, u*; takes about "
        "as long as the run",
        True,
    )
    correction: bool = key(
        "Correct force and torque on a grain for estimated errors of known sign; error bars are then those "
        "of the corrected values",
        True,
    )
    accuracy: Accuracy = key(
        'Requested relative error, or "verdict": until the verdict is conclusive; the mesh is then chosen',
        None,
        examples=[0.01],
    )
    accuracy_of: Literal[
        "auto",
        "force",
        "torque",
        "velocity",
        "safety factor",
        "elevation",
        "level",
        "shear velocity",
    ] = key(
        "Quantity to which `accuracy` applies; auto: force, of a free or released grain its velocity; without a grain "
        "elevation, with turbulence shear velocity",
        "auto",
    )
    accuracy_includes: Literal["discretisation", "all"] = key(
        "Errors included in `accuracy`; all: also of gap and domain, which are then chosen",
        "discretisation",
    )
    budget_seconds: Positive | None = key(
        "Wall time of the search for `accuracy` [s]", None, examples=[60.0]
    )
    budget_mib: Positive | None = key(
        "Memory of the search for `accuracy` [MiB]", None, examples=[2000.0]
    )
    interface_tolerance: Tolerance = key(
        "Error of a moving grain's equation of motion relative to its load; auto: as tolerance [-]",
        "auto",
    )
    remesh_below: float = key(
        "Quality of the worst cell, relative to that of a new mesh, below which to remesh",
        0.35,
        gt=0,
        lt=1,
    )
    tolerance: Tolerance = key(
        "Relative error of iterations; auto: steady 1e-6, with k-omega SST 1e-4, unsteady 0.1 of a step's own "
        "error [-]",
        "auto",
    )
    max_iterations: int = key("Largest number of Newton updates", 25, ge=1)
