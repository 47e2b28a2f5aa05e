"""The base flow, without grain and bedforms, and its inflow."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..geometry.plane.beds import effective_level
from ..scene import Domain, ExpressionFlow, LogLaw, OpenChannel, Poiseuille, Shear
from ..scene.expression import expressions
from ..scene.gust import Gust
from .mean_profile import MeanProfile

Velocity = Callable[[np.ndarray, float], np.ndarray]
Profile = Callable[[np.ndarray, np.ndarray], np.ndarray]

SAMPLES = 1000  # of heights for a mean
ROUND_OFF = 1e-9  # of the depth: largest distance below its datum at which a flow is evaluated
TERMS = 50  # of the series of a duct: it errs by less than 1e-5 of the mean velocity
# What inertia leaves of the depth of the effective height below the crests, (1 + R/INERTIAL)^-POWER with R = shear rate
# times period times that depth over the viscosity: measured over periods of half-discs and ripples
# (docs/explanation/flow.md).
INERTIAL, POWER = 10.0, 0.2
FEWEST_PERIODS = (
    2.0  # in the domain: along longer forms the flow is as over a bed that rises and falls
)
UNSURE = 0.5  # of what inertia changes; those measurements are within it where R is above 1
STEEPER = 3.0  # than the profile is its rise from a bed that is above the datum at the inflow


@dataclass(frozen=True)
class EffectiveHeight:
    """Height above the base line of the plane that is equivalent to a bed with roughness elements for the far flow."""

    height: float  # in the base flow at its speed
    uncertainty: float  # how far it may be off
    creeping: float  # without inertia


def repeats(flow: Any, domain: Domain, bed: Any) -> bool:
    """Whether a base flow of known shear at the bed passes several repeated bedforms in 2-D. Not collective."""
    if (
        domain.width is not None
        or bed is None
        or not isinstance(flow, Shear | Poiseuille | OpenChannel)
    ):
        return False
    return bool(bed.period and domain.length >= FEWEST_PERIODS * bed.period)


def effective_height(
    flow: Any, domain: Domain, bed: Any, viscosity: float, speed: float
) -> EffectiveHeight:
    """The effective height of a 2-D bed below a base flow `speed` times as fast. Not collective.

    viscosity: kinematic; inf without inertia
    """
    if not math.isfinite(bed.feature):
        return EffectiveHeight(0.0, 0.0, 0.0)
    level = effective_level(bed)
    depth = max(bed.crest - domain.bottom - level, 0.0)
    reynolds = (
        _shear_rate(flow, domain.ceiling - bed.crest) * (bed.period or 0.0) * depth / viscosity
    )
    lost = depth * (1.0 - (1.0 + speed * reynolds / INERTIAL) ** -POWER) if reynolds else 0.0
    return EffectiveHeight(level + lost, UNSURE * lost, level)


def _shear_rate(flow: Any, depth: float) -> float:
    """Shear rate at the bed below a depth of fluid; zero where it is not known."""
    if isinstance(flow, Shear):
        return flow.rate
    if isinstance(flow, Poiseuille | OpenChannel):
        return (6.0 if isinstance(flow, Poiseuille) else 3.0) * flow.velocity / depth
    return 0.0


@dataclass(frozen=True, eq=False)
class BaseFlow:
    """The flow without grain and bedforms, in units of the scene."""

    flow: Any  # the section of the scene that gives it
    domain: Domain
    bed: Any  # shape on which the inflow comes to rest; None without a bed
    reference: float  # velocity of the Reynolds number
    viscosity: float  # kinematic
    walled: bool = False  # whether the fluid sticks to the sides across the width
    creeping: bool = False  # whether inertia is left out, by which a computed datum is another one
    speed: float = 1.0  # of the flow for which the datum is computed, over this one's

    @property
    def over_forms(self) -> bool:
        """Whether the shear at the bed is known and the flow passes several repeated bedforms in 2-D."""
        return repeats(self.flow, self.domain, self.bed)

    @property
    def effective(self) -> bool:
        """Whether its profile starts at the effective height of the bed."""
        level = getattr(self.flow, "datum", "crest")
        return self.bed is not None and (
            level == "effective" or (level == "auto" and self.over_forms)
        )

    @cached_property
    def effective_height(self) -> EffectiveHeight:
        """The effective height of the 2-D bed."""
        viscosity = math.inf if self.creeping else self.viscosity
        return effective_height(self.flow, self.domain, self.bed, viscosity, self.speed)

    @cached_property
    def datum(self) -> float:
        """Height at which its profile starts, the same over the whole bed; below it the fluid is at rest."""
        domain, bed = self.domain, self.bed
        if bed is None:
            return domain.bottom
        if self.effective:
            return domain.bottom + self.effective_height.height
        level = getattr(self.flow, "datum", "crest")
        within: tuple[Any, ...] = domain.spans if self.domain.gdim == 3 else domain.spans[0]
        if level in ("auto", "crest"):
            return float(bed.crest_level(*within))
        return float(bed.mean(*within)) if level == "mean" else domain.bottom + float(level)

    @property
    def depth(self) -> float:
        """The depth from the datum to the top of the domain."""
        return self.domain.ceiling - self.datum

    @cached_property
    def mean_profile(self) -> MeanProfile:
        """The mean profile of a log-law flow."""
        assert isinstance(self.flow, LogLaw)
        return MeanProfile(
            self.flow.shear_velocity, self.viscosity, self.flow.roughness, self.depth
        )

    @property
    def gust(self) -> Gust | None:
        """The factor of the flow as a function of time; None: one."""
        return getattr(self.flow, "gust", None)

    @property
    def changes(self) -> bool:
        """Whether it changes in time."""
        return self.gust is not None or getattr(self.flow, "unsteady", False)

    def factor(self, t: float) -> float:
        """The factor of the flow at a time."""
        return 1.0 if self.gust is None else self.gust.factor(t)

    def velocity(self, x: np.ndarray, t: float) -> np.ndarray:
        """Velocities (gdim, n) at positions (3, n). Not collective."""
        return self._from(self.datum)(x, t)

    @cached_property
    def entering(self) -> Velocity:
        """The velocity (gdim, n) on the inflow at (3, n), t: brought to rest on a bed that is above the datum there.

        Not collective.
        """
        bed, datum = self.bed, self.datum
        if bed is None:
            return self.velocity
        if self.domain.gdim == 2:
            return self._from(max(datum, float(bed.height([self.domain.left])[0])))
        return self._from(lambda x: np.maximum(datum, bed.height(x[:2].T)))

    @property
    def mean_speed(self) -> float:
        """The reference velocity; of a log-law flow, whose reference is the shear velocity, the mean one."""
        if not isinstance(self.flow, LogLaw):
            return self.reference
        heights = self.depth * (np.arange(SAMPLES) + 0.5) / SAMPLES
        return float(np.mean(self._profile(heights, np.zeros(SAMPLES))))

    def column(self, place: Sequence[float], heights: np.ndarray) -> np.ndarray:
        """Points (3, n) of given heights above or below a position (gdim,). Not collective."""
        points = np.zeros((3, len(heights)))
        points[: self.domain.up] = np.array(place[: self.domain.up])[:, None]
        points[self.domain.up] = heights
        return points

    def bed_stress(self) -> float:
        """Shear stress at the datum of the flow `speed` times this one, with fluid density one.

        The stress of the profile is the same over the whole bed; between walls it is taken in the middle, of a flow
        given by formulas at the inflow. In a log-law flow it is u*^2, of which viscous stress is only a fraction where
        the bed is rough. Not collective.
        """
        if isinstance(self.flow, LogLaw):
            return float((self.speed * self.flow.shear_velocity) ** 2)
        step = 1e-6 * self.domain.height
        heights = self.datum + step * np.array([0.0, 1.0, 2.0])
        u = self.velocity(self.column(self.domain.entrance, heights), 0.0)[0]
        gradient = (-3 * u[0] + 4 * u[1] - u[2]) / (2 * step)
        return float(self.speed * self.viscosity * abs(gradient))

    def _from(self, foot: float | Callable[[np.ndarray], np.ndarray]) -> Velocity:
        """The flow at rest below `foot`, which is the datum or higher, or a function of positions (3, n)."""
        if isinstance(self.flow, ExpressionFlow):
            return self._formulas
        profile, datum, up = self._profile, self.datum, self.domain.up

        def velocity(x: np.ndarray, t: float) -> np.ndarray:
            """Velocities (gdim, n) at positions (3, n), along the first axis."""
            lowest = foot(x) if callable(foot) else foot
            speed = np.minimum(
                profile(x[up] - datum, x[1]), STEEPER * profile(x[up] - lowest, x[1])
            )
            return np.vstack([self.factor(t) * speed, *np.zeros((up, len(speed)))])

        return velocity

    @cached_property
    def _formulas(self) -> Velocity:
        components = expressions(self.flow.components, "flow.components")
        return lambda x, t: np.vstack([component(x, t) for component in components])

    @cached_property
    def _profile(self) -> Profile:
        """Speed against height above the datum, and y where sides are walls; none below the datum."""
        flow, depth = self.flow, self.depth
        if isinstance(flow, LogLaw):
            law = self.mean_profile
            return lambda z, y: law.speed(np.clip(z, 0.0, depth))
        if self.walled and flow.kind in ("poiseuille", "open-channel"):
            return self._in_duct(flow.velocity, depth if flow.kind == "poiseuille" else 2.0 * depth)
        # A uniform flow begins at the datum itself, to round-off.
        return lambda z, y: np.where(
            z < -ROUND_OFF * depth, 0.0, self.speed_at(np.clip(z, 0.0, depth))
        )

    def speed_at(self, z: Any) -> Any:
        """Speed at heights above the datum, numbers or a UFL expression; of flows with such a formula."""
        flow, depth = self.flow, self.depth
        if isinstance(flow, Shear):
            return flow.rate * z
        mean = {"still": 0.0}.get(flow.kind, flow.velocity)
        if flow.kind == "poiseuille":
            return 6 * mean * z * (depth - z) / depth**2
        return (
            1.5 * mean * z * (2 * depth - z) / depth**2
            if flow.kind == "open-channel"
            else mean + 0.0 * z
        )

    def profile(self, x: np.ndarray) -> np.ndarray:
        """Speed (n,) at positions (gdim or more, n) without a gust."""
        return self._profile(x[self.domain.up] - self.datum, x[1])

    def _in_duct(self, mean: float, depth: float) -> Profile:
        """The profile between walls: that of a duct of a depth, of which an open channel is the lower half."""
        (low, high), highest = self.domain.across, self.depth

        def speed(z: np.ndarray, y: np.ndarray) -> np.ndarray:
            across, up = np.clip(y - low, 0.0, high - low), np.clip(z, 0.0, highest)
            return mean * duct_speed(across, up, high - low, depth)

        return speed


def duct_speed(y: np.ndarray, z: np.ndarray, width: float, depth: float) -> np.ndarray:
    """Speed (n,) over its mean at distances y (n,) from one side and heights z (n,) above the bottom of a duct.

    For unit pressure gradient and viscosity u = z (depth - z)/2 less the sum over odd numbers n, with m = n pi/depth,
    of 4/(depth m^3) sin(m z) cosh(m e)/cosh(m width/2), e being the distance from the middle (White, Viscous Fluid
    Flow, section 3-3). Not collective.
    """
    half, away = 0.5 * width, np.abs(np.asarray(y) - 0.5 * width)
    speed = 0.5 * np.asarray(z) * (depth - np.asarray(z))
    for m in _wave_numbers(depth):
        # cosh(m e)/cosh(m half) without large numbers.
        fading = (np.exp(m * (away - half)) + np.exp(-m * (away + half))) / (
            1.0 + np.exp(-2.0 * m * half)
        )
        speed -= 4.0 / (depth * m**3) * np.sin(m * z) * fading
    return speed / duct_mean(width, depth)


def duct_mean(width: float, depth: float) -> float:
    """Mean velocity in a duct for a pressure gradient and a viscosity of one.

    It is depth^2/12 less the sum over odd n of 16 tanh(m width/2)/(width depth^2 m^5). Not collective.
    """
    m = _wave_numbers(depth)
    return float(
        depth**2 / 12.0 - np.sum(16.0 * np.tanh(0.5 * m * width) / (width * depth**2 * m**5))
    )


def _wave_numbers(depth: float) -> np.ndarray:
    return np.pi / depth * np.arange(1, 2 * TERMS, 2)
