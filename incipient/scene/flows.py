"""The section [flow]."""

import math
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from .domain import Top
from .expression import Expression
from .gusts import Gust
from .section import NotNegative, Positive, Rule, Section, formula, key

Words = Annotated[
    tuple[Annotated[str, formula("xyzt")], ...], Field(strict=False, min_length=2, max_length=3)
]
FEWEST = 8  # time steps in a period
Datum = float | Literal["auto", "effective", "crest", "mean"]


class FlowSection(Section):
    """A kind of flow, and its properties; a kind overrides those that differ.

    Attributes:
        top, tops: the upper side with domain.top = "auto", and the allowed values (empty: all).
        closed: whether the domain is a box (True), a channel (False), or either (None).
        parallel: whether convection leaves the flow unchanged.
        below_surface, modelled: whether a free surface or a turbulence model is allowed.
        wall_below: whether the lower side is a wall even though the upper one is none.
        unbounded: whether without a bed it extends beyond the domain above and below.
        stresses_bed, keeps_shape: whether the bed stress is known, and the profile independent of the speed.
        moves_top, by_formulas: whether the upper side slides; whether cells at the inflow resolve its velocity.
        scaled_by: the key of [units] that gives its speed.
        duct: height of a duct between side walls over the depth; 0: the sides do not change the flow.
        needs: rules between the flow and other sections.
        oscillates: whether it has a period.
        words: description, if "KIND flow" is none.
    """

    top: ClassVar[Top] = "stream"
    tops: ClassVar[tuple[Top, ...]] = ()
    closed: ClassVar[bool | None] = False
    at_rest: ClassVar[bool] = False
    parallel: ClassVar[bool] = True
    below_surface: ClassVar[bool] = False
    modelled: ClassVar[bool] = False
    wall_below: ClassVar[bool] = False
    unbounded: ClassVar[bool] = False
    stresses_bed: ClassVar[bool] = False
    keeps_shape: ClassVar[bool] = True
    moves_top: ClassVar[bool] = False
    by_formulas: ClassVar[bool] = False
    scaled_by: ClassVar[str] = "velocity"
    duct: ClassVar[float] = 0.0
    needs: ClassVar[tuple[Rule, ...]] = ()
    oscillates: ClassVar[bool] = False
    words: ClassVar[str] = ""

    @property
    def changes(self) -> bool:
        return self.oscillates or getattr(self, "gust", None) is not None

    @property
    def cycle(self) -> float:
        """Period of a flow that oscillates, prescribed at both ends; inf: none."""
        return math.inf

    @property
    def frequency(self) -> float:
        return 2.0 * math.pi / self.cycle

    def reference_velocity(self, length: float) -> float:
        return self.velocity  # type: ignore[attr-defined]

    def speed(self, z: Any, depth: float) -> Any:
        """Speed at heights z above the datum (floats, arrays or UFL) for the given depth."""
        return self.reference_velocity(depth) + 0.0 * z

    def shear_rate(self, depth: float) -> float:
        """Shear rate at the datum, by a complex step; zero if the speed has no formula."""
        return float(np.imag(self.speed(1e-20j * depth, depth)) / (1e-20 * depth))

    def numbers(self, size: float, viscosity: float) -> dict[str, float]:
        return {}


class Profile(FlowSection):
    """Common keys of flows with a given profile."""

    datum: Datum = key(
        "Origin of the profile: auto; effective height, crest or mean of the bed; or a height above its "
        "base line [length]",
        "auto",
    )


class Driven(Profile):
    """A flow with a given profile that a gust may multiply."""

    gust: Gust | None = key(
        "Factor on the flow over time",
        None,
        examples=[{"start": 1.0, "duration": 0.5, "strength": 2.0}],
    )


class Shear(Driven):
    """Linear shear flow, u = rate (y - y of the datum); in 3-D with z instead of y."""

    stresses_bed = True
    scaled_by = "shear_rate"
    kind: Literal["shear"] = key("Kind of flow", "shear")
    rate: Positive = key("Shear rate [1/time]; V = rate L", 1.0)

    def reference_velocity(self, length: float) -> float:
        return self.rate * length

    def speed(self, z: Any, depth: float) -> Any:
        return self.rate * z


class Poiseuille(Driven):
    """Parabolic flow between two walls."""

    top = "wall"
    tops = ("auto", "wall")
    modelled = stresses_bed = True
    duct = 1.0
    kind: Literal["poiseuille"] = key("Kind of flow", "poiseuille")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)

    def speed(self, z: Any, depth: float) -> Any:
        return 6 * self.velocity * z * (depth - z) / depth**2


class OpenChannel(Driven):
    """Half of a parabolic flow, without shear at the top."""

    top = "slip"
    tops = ("auto", "slip", "stream", "free-surface")
    below_surface = modelled = wall_below = stresses_bed = True
    duct = 2.0
    kind: Literal["open-channel"] = key("Kind of flow", "open-channel")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)

    def speed(self, z: Any, depth: float) -> Any:
        return 1.5 * self.velocity * z * (2 * depth - z) / depth**2


class Uniform(Driven):
    """Uniform flow above the datum."""

    below_surface = unbounded = True
    kind: Literal["uniform"] = key("Kind of flow", "uniform")
    velocity: Positive = key("Velocity V of the flow [length/time]", 1.0)


class LogLaw(Profile):
    """Logarithmic mean profile of channels, in a flow that is computed as laminar."""

    tops = ("auto", "slip", "stream")
    wall_below = stresses_bed = True
    keeps_shape = False
    words = "mean profile of a turbulent flow, maintained by a body force instead of the turbulent stress"
    kind: Literal["log-law"] = key("Kind of flow", "log-law")
    shear_velocity: Positive = key("Shear velocity V = u* = sqrt(tau_b / rho) [length/time]", 1.0)
    roughness: NotNegative = key(
        "Equivalent sand roughness k_s of the bed under the mean profile [length]", 0.0
    )

    def reference_velocity(self, length: float) -> float:
        return self.shear_velocity


class Oscillatory(Profile):
    """Stokes' boundary layer over a bed below long waves: U [cos wt - exp(-z/d) cos(wt - z/d)] at a height z."""

    tops = ("auto", "stream")
    stresses_bed = oscillates = True
    needs = (
        Rule("flow.kind", lambda s: s.time is None,
             '"oscillatory" changes in time but without [time] the flow is steady', "add a section [time]"),
        Rule("time.step", lambda s: s.time is not None and FEWEST * s.time.step > s.flow.period,
             f"is {{s.time.step:g}}, more than 1/{FEWEST} of flow.period", "reduce it"),
        Rule("time.start", lambda s: s.time is not None and s.time.changed("start"),
             'is not read with flow.kind = "oscillatory", which starts from its own layer', "leave it out"),
        Rule("time.until_steady", lambda s: s.time is not None and s.time.until_steady is not None,
             'is for a steady flow but flow.kind = "oscillatory" has none', "leave it out"),
        Rule("effects.unsteadiness", lambda s: s.effects.unsteadiness is False,
             "is false, but without a rate of change no oscillatory layer exists", 'use "auto"'),
        Rule("domain.sides", lambda s: s.gdim == 3 and s.sides == "wall",
             '"wall" contradicts the flow "oscillatory", which knows no side walls', 'use "slip" or "stream"'),
    )  # fmt: skip

    kind: Literal["oscillatory"] = key("Kind of flow", "oscillatory")
    velocity: Positive = key(
        "V = U, amplitude of the orbital velocity above the layer [length/time]", 1.0
    )
    period: Positive = key("Period of the oscillation; U is reached at time 0 [time]")

    @property
    def cycle(self) -> float:
        return self.period

    def thickness(self, viscosity: float) -> float:
        """d = (2 nu/w)^(1/2), the Stokes thickness."""
        return math.sqrt(2.0 * viscosity / self.frequency)

    def numbers(self, size: float, viscosity: float) -> dict[str, float]:
        """Keulegan-Carpenter number, layer thickness over the grain's size, the layer's Reynolds number."""
        thickness = self.thickness(viscosity)
        return {
            "KC": self.velocity * self.period / size,
            "delta/d": thickness / size,
            "Re_delta": self.velocity * thickness / viscosity,
        }


class Lid(FlowSection):
    """A box whose top slides."""

    top = "wall"
    tops = ("auto", "wall")
    closed = moves_top = True
    parallel = False
    kind: Literal["lid"] = key("Kind of flow", "lid")
    velocity: Positive = key("Velocity V of the lid [length/time]", 1.0)


class ExpressionFlow(FlowSection):
    """A velocity given by formulas, on the inflow and on the top."""

    rules = (
        Rule("components",
             lambda s: len(s.components) == 2 and [c for c in s.components if "z" in Expression(c).variables],
             '"{v}" depends on z but the scene is two-dimensional', "use x, y, t only"),
    )  # fmt: skip
    closed = None
    parallel = False
    unbounded = by_formulas = True
    kind: Literal["expression"] = key("Kind of flow", "expression")
    components: Words = key(
        "Two formulas in x, y and t for the velocity; in 3-D three in x, y, z and t [length/time]"
    )
    velocity: Positive = key("Reference velocity V [length/time]", 1.0)

    @property
    def changes(self) -> bool:
        return any("t" in Expression(text).variables for text in self.components)


class Still(FlowSection):
    """Fluid at rest."""

    top = "wall"
    closed = None
    at_rest = below_surface = True
    words = "the fluid is at rest"
    kind: Literal["still"] = key("Kind of flow", "still")
    velocity: Positive = key("Velocity V used for scaling only [length/time]", 1.0)

    def speed(self, z: Any, depth: float) -> Any:
        return 0.0 * z


Flow = Annotated[
    Shear
    | Poiseuille
    | OpenChannel
    | Uniform
    | LogLaw
    | Oscillatory
    | Lid
    | ExpressionFlow
    | Still,
    Field(discriminator="kind"),
]


def kinds(fact: str) -> tuple[str, ...]:
    """The kinds of flow for which a class attribute is true."""
    sections = get_args(get_args(Flow)[0])
    return tuple(
        section.model_fields["kind"].default for section in sections if getattr(section, fact)
    )
