"""The sections [flow], its gust, and [gusts], fluctuations for `incipient entrainment`."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from .expression import Expression
from .messages import either
from .section import (
    FromFile,
    NotNegative,
    Pairs,
    Positive,
    Rule,
    Section,
    file_key,
    formula,
    key,
    rises,
)
from .sections import Top

# Laws of data, and the least number of points of a series, and of gusts that were counted.
AT_LEAST = {"measured": 100, "events": 20}
NEAR_WALL, MODEL = "near-wall", "model"
Words = Annotated[
    tuple[Annotated[str, formula("xyzt")], ...], Field(strict=False, min_length=2, max_length=3)
]
FEWEST = 8  # time steps in a period


class Gust(FromFile):
    """Factor on the flow over time: 1 before and after the gust, `strength` at its maximum."""

    columns, may_be_absent = "time, factor", True
    rules = (
        Rule("file", lambda s: s.shape == "points" and not s.points,
             "neither file nor points is given", "give one of them"),
        Rule("points", lambda s: s.shape == "points" and (len(s.points) < 2 or not rises(s.points)),
             "are fewer than two, or their times do not increase", "give two or more, sorted by time, or a file"),
        Rule("points", lambda s: s.shape != "points" and s.points,
             'are not read with shape = "{s.shape}"', 'set shape = "points"'),
        Rule("{v}", lambda s: s.shape == "points" and next(filter(s.changed, ("duration", "strength")), None),
             'is not read with shape = "points"', "leave it out"),
        Rule("rise", lambda s: s.rise is not None and s.shape != "top-hat",
             'is read only with shape = "top-hat"', "leave it out"),
        Rule("rise", lambda s: s.rise is not None and s.rise > s.duration,
             "is {s.rise:g}, more than the duration", "reduce it"),
    )  # fmt: skip

    shape: Literal["top-hat", "cosine", "points"] = key(
        "Shape over time: a plateau with smooth ramps, a raised cosine, or given points",
        "top-hat",
    )
    start: NotNegative = key("Start of the gust [time]", 0.0)
    duration: Positive = key(
        "Duration; of a top-hat from the start of its rise to the start of its fall [time]", 1.0
    )
    strength: NotNegative = key("Maximum of the factor on the flow [-]", 2.0)
    rise: Positive | None = key(
        "Rise and fall time of a top-hat; default: a tenth of the duration [time]",
        None,
        examples=[0.1],
    )
    file: str | None = file_key("CSV file of time, factor,", "points", "gust.csv")
    points: Pairs = key(
        'With shape = "points": time after the start and factor, linear in between [time, -]', ()
    )

    @property
    def ramps(self) -> tuple[float, float]:
        """Times from the start of the rise to that of the fall, and of each; a raised cosine falls once risen."""
        if self.shape == "cosine":
            return 0.5 * self.duration, 0.5 * self.duration
        return self.duration, 0.1 * self.duration if self.rise is None else self.rise

    def knots(self) -> np.ndarray:
        if self.shape == "points":
            return self.start + np.array([time for time, _ in self.points])
        fall, rise = self.ramps
        whole = fall + rise
        sides = np.concatenate([[0.0, 1.0], np.linspace(0.0, rise / whole, 5)])
        return self.start + whole * np.unique(
            np.concatenate([sides, 1.0 - sides, np.linspace(0.0, 1.0, 9)])
        )

    def kinks(self, step: float) -> np.ndarray:
        """Times at which the slope jumps: of points, and of the ramps of a top-hat that steps do not resolve.

        Points within a step or so of both neighbours sample a curve.
        """
        few, (fall, rise) = 1.5 * step, self.ramps
        if self.shape == "points":
            knots = self.knots()
            apart = np.diff(knots, prepend=-np.inf, append=np.inf) > few
            return knots[apart[:-1] | apart[1:]]
        ends = self.start + np.array([0.0, rise, fall, fall + rise])
        return ends if rise < few else ends[:0]

    def factor(self, time: Any) -> Any:
        """The factor at times, a number or an array."""
        since = time - self.start
        if self.shape == "points":
            times, factors = zip(*self.points, strict=True)
            return np.interp(since, times, factors)
        fall, rise = self.ramps
        height = _smooth(since / rise) - _smooth((since - fall) / rise)
        return 1.0 + (self.strength - 1.0) * height


def _smooth(share: Any) -> Any:
    return 0.5 - 0.5 * np.cos(math.pi * np.clip(share, 0.0, 1.0))


class FlowSection(Section):
    """A kind of flow, and its properties; a kind overrides those that differ.

    Attributes:
        tops: the allowed upper sides, of which domain.top = "auto" is the first.
        closed: whether the domain is a box (True), a channel (False), or either (None).
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

    tops: ClassVar[tuple[Top, ...]] = ("stream", "wall", "slip", "free-surface")
    closed: ClassVar[bool | None] = False
    at_rest: ClassVar[bool] = False
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
    def is_zero(self) -> bool:
        """Whether it prescribes no velocity."""
        return self.at_rest

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

    datum: float | Literal["auto", "effective", "crest", "mean"] = key(
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

    tops = ("wall",)
    modelled = stresses_bed = True
    duct = 1.0
    kind: Literal["poiseuille"] = key("Kind of flow", "poiseuille")
    velocity: Positive = key("Mean velocity V [length/time]", 1.0)

    def speed(self, z: Any, depth: float) -> Any:
        return 6 * self.velocity * z * (depth - z) / depth**2


class OpenChannel(Driven):
    """Half of a parabolic flow, without shear at the top."""

    tops = ("slip", "stream", "free-surface")
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

    tops = ("stream", "slip")
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

    tops = ("stream",)
    stresses_bed = oscillates = True
    words = (
        "oscillatory flow; its Shields number, Re* and u* are of the largest bed stress in a period"
    )
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

    tops = ("wall",)
    closed = moves_top = True
    kind: Literal["lid"] = key("Kind of flow", "lid")
    velocity: Positive = key("Velocity V of the lid [length/time]", 1.0)


class ExpressionFlow(FlowSection):
    """A velocity given by formulas, on the inflow and on the top."""

    rules = (
        Rule("components",
             lambda s: len(s.components) == 2 and [c for c in s.components if "z" in Expression(c).variables],
             '"{v}" depends on z but they are two, as in 2-D', "give three, or use x, y, t only"),
    )  # fmt: skip
    closed = None
    unbounded = by_formulas = True
    kind: Literal["expression"] = key("Kind of flow", "expression")
    components: Words = key(
        "Two formulas in x, y and t for the velocity; in 3-D three in x, y, z and t [length/time]"
    )
    velocity: Positive = key("Reference velocity V [length/time]", 1.0)

    @property
    def is_zero(self) -> bool:
        formulas = [Expression(text) for text in self.components]
        return not any(formula.variables or formula(np.zeros((3, 1))).any() for formula in formulas)

    @property
    def changes(self) -> bool:
        return any("t" in Expression(text).variables for text in self.components)


class Still(FlowSection):
    """Fluid at rest."""

    tops = ("wall", "slip", "stream", "free-surface")
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


def kinds(fact: str) -> str:
    """The kinds of flow for which a class attribute is true, in words."""
    sections = get_args(get_args(Flow)[0])
    return either([s.model_fields["kind"].default for s in sections if getattr(s, fact)])


# -- fluctuations ----------------------------------------------------------------------------------


def _of_data(s: Any) -> list[str]:
    keys = ("intensity", "microscale", *(("integral_time",) if s.law == "events" else ()))
    return [key for key in keys if s.law in AT_LEAST and getattr(s, key) is not None][:1]


def _flat(s: Any) -> bool:
    speeds = [speed for _, speed in s.points]
    return s.law == "measured" and (not math.fsum(speeds) > 0.0 or min(speeds) == max(speeds))


def _too_short(s: Any) -> bool:
    return (
        None not in (s.integral_time, s.microscale)
        and s.integral_time < math.sqrt(2.0) * s.microscale
    )


class Gusts(FromFile):
    """Random factor with mean 1 on the velocity at the grain."""

    fewest, may_be_absent = 1, True
    rules = (
        Rule("points", lambda s: s.law not in AT_LEAST and s.points,
             'are not read with law = "{s.law}"', 'set law = "measured" or "events"'),
        Rule("intensity", lambda s: s.law not in AT_LEAST and s.intensity is None,
             "is missing", 'give a number, "near-wall" or "model"'),
        Rule("{v}", _of_data, 'follows from the data with law = "{s.law}"', "leave it out"),
        Rule("points", lambda s: len(s.points) < AT_LEAST.get(s.law, 0) and (len(s.points), AT_LEAST[s.law]),
             "are {v[0]}", "give {v[1]} or more, or a file"),
        Rule("points", lambda s: s.law == "events" and min(map(min, s.points)) <= 0.0,
             "have a strength or duration that is not above zero", "leave it out"),
        Rule("record", lambda s: s.law == "events" and s.record is None,
             "is missing: the duration in which the events were counted", "give it"),
        Rule("record", lambda s: s.law != "events" and s.record is not None,
             'is read only with law = "events"', "leave it out"),
        Rule("record",
             lambda s: s.record is not None and (total := math.fsum(d for _, d in s.points)) > s.record and total,
             "is {s.record:g}, less than the total duration of the events, {v:g}",
             "enlarge it, or merge events that overlap"),
        Rule("points", lambda s: s.law == "measured" and not rises(s.points),
             "their times do not increase", "sort them by time, each once"),
        Rule("points", _flat, "have no mean above zero, or no fluctuation", "give velocities downstream"),
        Rule("depth", lambda s: s.depth is not None and s.intensity != NEAR_WALL,
             'is read only with intensity = "near-wall"', "leave it out"),
        Rule("integral_time", lambda s: s.law not in AT_LEAST and s.integral_time is not None and s.microscale is None,
             "is given without microscale: an exponential correlation, whose upcrossings are infinitely many",
             "also give gusts.microscale"),
        Rule("integral_time", lambda s: s.law not in AT_LEAST and _too_short(s),
             "is {s.integral_time:g}, less than the microscale times the square root of two",
             "enlarge it, or reduce gusts.microscale"),
    )  # fmt: skip

    law: Literal["lognormal", "normal", "measured", "events"] = key(
        "Distribution of the factor; measured: of a time series; events: of counted gusts",
        "lognormal",
    )
    intensity: Positive | Literal["near-wall", "model"] | None = key(
        "Turbulence intensity relative to the mean velocity at the grain [-]; near-wall: from a law of the wall "
        "region; model: from k of the inflow",
        None,
        examples=[0.3],
    )
    depth: Positive | None = key(
        'Depth of the flow, for intensity = "near-wall"; default: much larger than the grain [length]',
        None,
        examples=[20.0],
    )
    microscale: Positive | None = key(
        "Microscale lambda of the correlation 1 - (t/lambda)^2 at short times, for rates [time]",
        None,
        examples=[0.5],
    )
    integral_time: Positive | None = key(
        "Integral time scale, for gusts that last long enough; a measured series has its own [time]",
        None,
        examples=[2.0],
    )
    record: Positive | None = key(
        'With law = "events": duration of the record [time]', None, examples=[600.0]
    )
    file: str | None = file_key(
        "CSV file of time, velocity, or of strength, duration,", "points", "velocity.csv"
    )
    points: Pairs = key(
        'With law = "measured": time and velocity at the grain, in any unit [time, -]; with "events": velocity over '
        "its mean, and duration of the gust [-, time]",
        (),
    )
