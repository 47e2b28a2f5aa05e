"""The base flow, without grain and bedforms, and its inflow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..arrays import Floats, spatial
from ..geometry.plane.beds import effective_level
from ..scene import Scene
from ..scene.expression import Expression, expressions
from ..scene.flows import Gust

KAPPA, DAMPING = 0.41, 26.0
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
LAYER = 10.0  # wall units, between the viscous sublayer and the logarithmic law


@dataclass(frozen=True)
class MeanProfile:
    """The mean velocity of a log-law flow over its datum, in scene units.

    With heights y and velocities in units of nu/u* and u*, the mixing length kappa (y + s) (1 - exp(-(y + s)/26)) gives

        du/dy = 2/(1 + sqrt(1 + 4 kappa^2 (y + s)^2 (1 - exp(-(y + s)/26))^2)),  s = 0.9 (sqrt(k) - k exp(-k/6)),

    k being the equivalent sand roughness: u = y within the viscous sublayer of a smooth bed, the logarithmic law above
    (van Driest 1956, J. Aeronaut. Sci. 23, 1007; the shift s of rough beds: Cebeci & Chang 1978, AIAA J. 16, 730). For
    k of 70 to 500 that is within 0.3 of Nikuradse's law, u = ln(y/k)/kappa + 8.5.
    """

    shear_velocity: float
    viscosity: float
    roughness: float  # k [length]
    depth: float  # of the flow above its datum, up to which it is tabulated

    @property
    def roughness_reynolds(self) -> float:
        """k = u* k_s/nu."""
        return self.roughness * self.per_length

    @property
    def per_length(self) -> float:
        return self.shear_velocity / self.viscosity

    @property
    def layer(self) -> float:
        """Height over which the profile bends: ten wall units, or the shift of a rough bed [length]."""
        return max(LAYER, self.shift) / self.per_length

    @property
    def mean(self) -> float:
        """Mean speed over the depth."""
        depth = self.depth * self.per_length
        return self.shear_velocity * float(self._table.integrate(0.0, depth)) / depth

    def speed(self, heights: np.ndarray) -> np.ndarray:
        """Mean speeds (n,) at heights (n,) above the datum, of zero to the depth."""
        return self.shear_velocity * np.asarray(self._table(heights * self.per_length))

    @cached_property
    def _table(self) -> Any:
        from scipy.interpolate import CubicSpline

        y = np.sinh(np.linspace(0.0, np.arcsinh(self.depth * self.per_length), 400))
        return CubicSpline(y, gradient(y, self.shift, np)).antiderivative()

    @property
    def shift(self) -> float:
        k = self.roughness_reynolds
        return max(0.9 * (math.sqrt(k) - k * math.exp(-k / 6.0)), 0.0)


def regime(k: float) -> str:
    """Hydraulic regime of a bed with k = u* k_s/nu (Nikuradse 1933)."""
    word = "smooth" if k <= 5.0 else "rough" if k >= 70.0 else "between smooth and rough"
    return f"hydraulically {word}"


def gradient(y: Any, shift: Any, functions: Any) -> Any:
    """The gradient du/dy at y, in wall units, with the functions of numpy or of UFL."""
    mixing = KAPPA * (y + shift) * (1 - functions.exp(-(y + shift) / DAMPING))
    return 2 / (1 + functions.sqrt(1 + 4 * mixing**2))


@dataclass(frozen=True, eq=False)
class BaseFlow:
    """The flow without grain and bedforms, in units of the scene. No method is collective.

    Kinds whose profile depends on more than height and depth derive from it, see `KINDS`.
    `speed`: of the flow for which the datum is computed, over the scene's.
    """

    scene: Scene
    speed: float = 1.0

    @cached_property
    def flow(self) -> Any:  # a section with the keys of its kind
        return self.scene.flow

    # -- what a kind of flow may override ----------------------------------------------------------

    @property
    def layer(self) -> float:
        """Height over which the profile bends next to the bed, which cells resolve; inf: the domain [length]."""
        return math.inf

    @property
    def mean_speed(self) -> float:
        """Mean speed; of shear that over the grain's size at any `fluid.scale`, without a grain over the height."""
        grain = self.scene.grain
        return self.flow.reference_velocity(
            self.scene.domain.height if grain is None else grain.size
        )

    @property
    def body_force(self) -> Callable[[Any, Any], Any] | None:
        """Force per unit mass that sustains the flow, a function of position and time (UFL), or None."""
        return None

    def instants(self, samples: int) -> np.ndarray:
        """Times (n,) that resolve the flow, with no period, and those of a gust; without [time] zero alone."""
        end = self.scene.time.end if self.scene.time else 0.0
        knots = np.empty(0) if self.gust is None else self.gust.knots()
        # Evenly spaced times may all be zeros of a periodic flow: each is within its own interval.
        number = np.arange(samples - 1)
        times = end * (number + number * GOLDEN % 1.0) / (samples - 1)
        return np.union1d([*times, end], knots[(knots >= 0.0) & (knots <= end)])

    def driving_speed(self, z: Any) -> Any:
        """Speed at factor one at heights from zero to the depth, numbers or UFL."""
        return self.flow.speed(z, self.depth)

    def profile(self, z: Floats, y: Floats, t: Any) -> Floats:
        """Speed (n,) at heights above the datum, and y between side walls; zero below the datum."""
        speed = self.at_factor_one(z, y)
        return speed if self.gust is None else self.gust.factor(t) * speed

    def bed_stress(self) -> float:
        """Shear stress at the datum of the flow `speed` times this one, with fluid density one.

        Between walls it is that in the middle, of a flow given by formulas at the inflow.
        """
        step = 1e-6 * self.scene.domain.height
        top = self.datum + 2.0 * step
        u = self.sampled(self.scene.domain.entrance, self.datum, top, number=3)[0, 0]
        gradient = (-3 * u[0] + 4 * u[1] - u[2]) / (2 * step)
        return float(self.speed * self.scene.viscosity * abs(gradient))

    def velocity(self, x: np.ndarray, t: Any) -> np.ndarray:
        speed = self.profile(x[self.scene.up] - self.datum, x[1], t)
        return np.vstack([speed, *np.zeros((self.scene.up, len(speed)))])

    def entering(self, x: np.ndarray, t: float) -> np.ndarray:
        """Inflow velocity (gdim, n) at (3, n), t: at rest on a bed above the datum, at both ends if it oscillates."""
        ends = (self.scene.domain.left, self.scene.domain.right)[: 1 + self.flow.oscillates]
        return at_rest_on(self.scene, ends, self.datum, partial(self.velocity, t=t), x)

    # -- what all have -----------------------------------------------------------------------------

    @property
    def gust(self) -> Gust | None:
        return getattr(self.flow, "gust", None)

    @property
    def creeping(self) -> bool:
        """Whether inertia is left out, without which a computed datum is another."""
        return not self.scene.fluid.inertia or self.scene.effects.inertia is False

    @property
    def over_forms(self) -> bool:
        scene = self.scene
        return scene.gdim == 2 and scene.repeats_forms and self.flow.shear_rate(1.0) != 0.0

    @cached_property
    def level(self) -> float | str:
        """What the datum is: a height above the base line, "effective", "crest" or "mean"."""
        level: float | str = getattr(self.flow, "datum", "crest")
        return level if level != "auto" else "effective" if self.over_forms else "crest"

    @cached_property
    def effective_height(self) -> tuple[float, float]:
        """Height above the base line of the plane equivalent to a bed with roughness elements for the far flow.

        In the base flow at its speed; and how far it may be off.
        """
        domain, bed = self.scene.domain, self.scene.bed_shape
        if not math.isfinite(bed.feature):
            return 0.0, 0.0
        level = effective_level(bed)
        depth = max(bed.crest - domain.bottom - level, 0.0)
        shear = self.flow.shear_rate(domain.ceiling - bed.crest)
        reynolds = (
            0.0 if self.creeping else shear * (bed.period or 0.0) * depth / self.scene.viscosity
        )
        # Of the depth inertia leaves (1 + R/10)^-0.2 with R = shear rate times period times depth over the viscosity:
        # measured over periods of half-discs and ripples (docs/explanation/flow.md).
        lost = depth * (1.0 - (1.0 + self.speed * reynolds / 10.0) ** -0.2)
        # Measurements are within half of what inertia changes where R is above 1.
        return level + lost, 0.5 * lost

    @cached_property
    def datum(self) -> float:
        """Height at which the profile starts; below it the fluid is at rest."""
        domain, bed = self.scene.domain, self.scene.bed_shape
        if self.level in ("crest", "mean"):
            return float((bed.crest_level if self.level == "crest" else bed.mean)(*domain.spans))
        above = self.effective_height[0] if self.level == "effective" else float(self.level)
        return domain.bottom + above

    @property
    def depth(self) -> float:
        return self.scene.domain.ceiling - self.datum

    @property
    def round_off(self) -> float:
        """Depth below the datum over which the flow is that at the datum, as of a uniform flow [length]."""
        return 1e-9 * self.depth

    def column(self, place: Sequence[float], heights: np.ndarray) -> np.ndarray:
        level = np.tile(place[: self.scene.up], (len(heights), 1))
        return spatial(np.column_stack([level, heights])).T

    def sampled(
        self,
        place: Sequence[float],
        low: float,
        high: float,
        times: Sequence[float] | Floats = (0.0,),
        number: int = 33,
    ) -> Floats:
        """Velocities (times, gdim, heights) over a place, at a number of heights from a low to a high level."""
        points = np.tile(self.column(place, np.linspace(low, high, number)), len(times))
        velocities = self.velocity(points, np.repeat(times, number))
        return np.moveaxis(velocities.reshape(-1, len(times), number), 0, 1)

    def at_factor_one(self, z: Floats, y: Floats) -> Floats:
        depth, inside = self.depth, np.clip(z, 0.0, self.depth)
        if self.scene.gdim == 3 and self.scene.sides == "wall" and self.flow.duct:
            low, high = self.scene.domain.across
            across, whole = np.clip(y - low, 0.0, high - low), self.flow.duct * depth
            speed = self.flow.velocity * duct_speed(across, inside, high - low, whole)
        else:
            speed = self.driving_speed(inside)
        return np.where(z < -self.round_off, 0.0, speed)


def at_rest_on(
    scene: Scene,
    ends: Sequence[float],
    datum: float,
    velocity: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
) -> np.ndarray:
    """Velocity (gdim, n) at positions (3, n), which vanishes on the bed at both `ends` where that is above the datum.

    From there it rises three times as steeply as the profile above the datum.
    """
    values = velocity(x)
    places = (np.column_stack([np.full(x.shape[1], end), x[1]]) for end in ends)
    above = np.max([scene.bed_height(place) for place in places], axis=0) - datum
    if np.any(above > 0.0):
        lowered = x.copy()
        lowered[scene.up] -= np.maximum(above, 0.0)
        rise = 3.0 * velocity(lowered)[0]
        values[0] = np.where(np.abs(rise) < np.abs(values[0]), rise, values[0])
    return values


class LogLawFlow(BaseFlow):
    """The mean profile of a turbulent flow, sustained by a force."""

    @cached_property
    def mean_profile(self) -> MeanProfile:
        flow = self.flow
        return MeanProfile(flow.shear_velocity, self.scene.viscosity, flow.roughness, self.depth)

    @property
    def layer(self) -> float:
        return self.mean_profile.layer

    @property
    def mean_speed(self) -> float:
        return self.mean_profile.mean

    @property
    def body_force(self) -> Callable[[Any, Any], Any]:
        import ufl
        from dolfinx import fem
        from ufl.domain import extract_domains

        from ..compat import PETSc

        profile, up = self.mean_profile, self.scene.up
        scale = profile.shear_velocity**2 * profile.per_length
        values = self.datum, scale, profile.per_length, profile.shift

        def force(place: Any, time: Any) -> Any:
            """-nu d2u/dy2 above the datum, zero below it; constants, so that nothing is recompiled."""
            (domain,) = extract_domains(place)
            bottom, scale, per_length, shift = (
                fem.Constant(domain, PETSc.ScalarType(value)) for value in values
            )
            y = ufl.variable((place[up] - bottom) * per_length)
            along = ufl.conditional(ufl.gt(y, 0), -scale * ufl.diff(gradient(y, shift, ufl), y), 0)
            return ufl.as_vector([along, *[0] * up])

        return force

    def driving_speed(self, z: Any) -> Any:
        return self.mean_profile.speed(z)

    def bed_stress(self) -> float:
        """u*^2, of which viscous stress is only a fraction over a rough bed."""
        return float((self.speed * self.flow.shear_velocity) ** 2)


class OscillatoryFlow(BaseFlow):
    """Stokes' oscillatory boundary layer (Stokes 1851; Batchelor 1967, An Introduction to Fluid Dynamics, 4.3)."""

    @property
    def layer(self) -> float:
        return self.flow.thickness(self.scene.viscosity)

    def instants(self, samples: int) -> np.ndarray:
        return np.linspace(0.0, self.flow.period, samples)

    def profile(self, z: Floats, y: Floats, t: Any) -> Floats:
        """The layer at an instant; the bed stress leads the flow above by an eighth of the period."""
        phase, eta = self.flow.frequency * t, np.maximum(z, 0.0) / self.layer
        return self.flow.velocity * (np.cos(phase) - np.exp(-eta) * np.cos(phase - eta))

    def bed_stress(self) -> float:
        """The largest in time, U (w nu)^(1/2)."""
        return (
            self.speed * self.flow.velocity * math.sqrt(self.flow.frequency * self.scene.viscosity)
        )


class FormulaFlow(BaseFlow):
    """A velocity given by formulas."""

    def velocity(self, x: np.ndarray, t: Any) -> np.ndarray:
        return np.vstack([component(x, t) for component in self._formulas])

    def entering(self, x: np.ndarray, t: float) -> np.ndarray:
        return self.velocity(x, t)

    @cached_property
    def _formulas(self) -> list[Expression]:
        return expressions(self.flow.components, "flow.components")


# Flows that are not `FlowSection.speed` times a factor, by flow.kind.
KINDS = {"log-law": LogLawFlow, "oscillatory": OscillatoryFlow, "expression": FormulaFlow}


def duct_speed(y: np.ndarray, z: np.ndarray, width: float, depth: float) -> np.ndarray:
    """Speed (n,) over its mean at distances y (n,) from one side and heights z (n,) above the bottom of a duct.

    For unit pressure gradient and viscosity u = z (depth - z)/2 less the sum over odd n, with m = n pi/depth, of
    4/(depth m^3) sin(m z) cosh(m e)/cosh(m width/2), e being the distance from the middle (White, Viscous Fluid Flow,
    section 3-3).
    """
    m, half, away = _wave_numbers(depth)[:, None], 0.5 * width, np.abs(y - 0.5 * width)
    # cosh(m e)/cosh(m half) without large numbers.
    fading = np.exp(m * (away - half)) + np.exp(-m * (away + half))
    series = 4.0 / (depth * m**3) * np.sin(m * z) * fading / (1.0 + np.exp(-2.0 * m * half))
    return (0.5 * z * (depth - z) - series.sum(axis=0)) / duct_mean(width, depth)


def duct_mean(width: float, depth: float) -> float:
    """Mean velocity in a duct for a pressure gradient and a viscosity of one.

    It is depth^2/12 less the sum over odd n of 16 tanh(m width/2)/(width depth^2 m^5).
    """
    m = _wave_numbers(depth)
    return float(
        depth**2 / 12.0 - np.sum(16.0 * np.tanh(0.5 * m * width) / (width * depth**2 * m**5))
    )


def _wave_numbers(depth: float) -> np.ndarray:
    # With 50 terms speeds err by less than 1e-5 of the mean.
    return np.pi / depth * np.arange(1, 100, 2)
