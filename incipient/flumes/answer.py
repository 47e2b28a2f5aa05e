"""Whether a bed of grains moves in a flume, from grain, water and flow in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any

from scipy.optimize import brentq

from ..errors import refuse_broken
from ..scene import loads
from ..setup.base_flow import MeanProfile, regime
from ..setup.setup import Setup
from .thresholds import (
    OFTEN,
    SELDOM,
    NaturalBed,
    natural_bed,
    observed_fraction,
    soulsby_whitehouse,
    zanke,
)

# The least fraction of observed beds that move, and the answer.
ANSWERS = (
    (0.95, "To an observer the bed moves"),
    (0.75, "To an observer the bed probably moves"),
    (0.25, "To an observer the bed is near its threshold"),
    (0.05, "To an observer the bed probably stays at rest"),
    (0.0, "To an observer the bed stays at rest"),
)
SLOWEST, FASTEST = 1e-6, 1e2  # u* [m/s]
# Numbers that are accepted, in SI units: all flumes and rivers, far from overflow. Water is liquid from 0 to 100 °C.
RANGES = {
    "diameter": (1e-6, 10.0),
    "density": (1.0, 3e4),
    "depth": (1e-5, 1e4),
    "shear_velocity": (SLOWEST, FASTEST),
    "velocity": (1e-9, 1e4),
    "slope": (1e-8, 1.0),
    "viscosity": (1e-8, 1.0),
    "fluid_density": (0.1, 2e4),
    "gravity": (1e-3, 1e3),
    "temperature": (0.0, 100.0),
}
OF_WATER = 0.1  # relative difference of densities up to which a fluid has water's viscosity
OBSERVED = 0.38, 1705.0  # D* of the observed beds
# Angle of repose [degrees], Soulsby (1997); factor of a slope on critical numbers below which it is mentioned.
REPOSE, STEEP = 32.0, 0.9
ROUGHNESS = 1.0  # k_s of the bed over the grains' diameter, as of the natural bed
SHALLOWEST, DEEPEST = 5.0, 30.0  # depths of the scene of a grain [d]
RESOLVED = 30.0  # u* d/nu from which the flow past the grain is turbulent there
IN_LOGARITHMIC_LAYER = 300.0  # u* d/nu from which its walls are, see docs/howto/flow.md


@dataclass(frozen=True)
class FlumeAnswer:
    """A bed of equal grains in a flow: dimensionless numbers, critical Shields numbers, and the answer. SI units.

    shear_velocity: u*, given, or from depth and slope, or from depth and mean velocity
    mean_velocity:  over the depth, by the logarithmic law over a bed of these grains; None without a depth
    """

    diameter: float
    density: float
    fluid_density: float
    viscosity: float
    gravity: float
    shear_velocity: float
    depth: float | None
    mean_velocity: float | None
    source: str  # of u*, in words
    slope: float = 0.0  # rise over length, if u* follows from it

    @property
    def shear_reynolds(self) -> float:
        """u* d/nu."""
        return self.shear_velocity * self.diameter / self.viscosity

    @property
    def bed_stress(self) -> float:
        """[Pa]."""
        return self.fluid_density * self.shear_velocity**2

    @property
    def shields(self) -> float:
        """Bed stress over (rho_s - rho_f) g d."""
        excess = self.density - self.fluid_density
        return self.bed_stress / (excess * self.gravity * self.diameter)

    @property
    def dimensionless_diameter(self) -> float:
        """D* = d (g (s - 1)/nu^2)^(1/3)."""
        reduced = self.gravity * (self.density / self.fluid_density - 1.0)
        return float(self.diameter * (reduced / self.viscosity**2) ** (1.0 / 3.0))

    @property
    def regime(self) -> str:
        return regime(ROUGHNESS * self.shear_reynolds)

    @property
    def froude(self) -> float | None:
        if self.depth is None or self.mean_velocity is None:
            return None
        return self.mean_velocity / math.sqrt(self.gravity * self.depth)

    @property
    def curve(self) -> float:
        """Critical Shields number by Soulsby and Whitehouse."""
        return float(soulsby_whitehouse(self.dimensionless_diameter))

    @property
    def zanke(self) -> float | None:
        return zanke(self.dimensionless_diameter)

    @property
    def natural_bed(self) -> NaturalBed | None:
        return natural_bed(self.shear_reynolds)

    @property
    def slope_factor(self) -> float:
        """The fraction of critical numbers left on the slope (Soulsby 1997, Dynamics of Marine Sands, equation 80)."""
        repose = math.radians(REPOSE)
        return max(math.sin(repose - math.atan(self.slope)), 0.0) / math.sin(repose)

    @property
    def level_shields(self) -> float:
        """Shields number as near to its threshold on a level bed; infinite from the angle of repose on."""
        return self.shields / self.slope_factor if self.slope_factor else math.inf

    @property
    def observed(self) -> float:
        """Fraction of observed beds that move at this Shields number or below, 0.01 to 0.99."""
        return observed_fraction(self.level_shields / self.curve)

    @property
    def sentence(self) -> str:
        answer = next(words for least, words in ANSWERS if self.observed >= least)
        text = (
            f"{answer}: {_bounded(self.observed, 0.01, 0.99)} of observed beds have a lower critical Shields number, "
            "relative to Soulsby & Whitehouse"
        )
        if not OBSERVED[0] <= self.dimensionless_diameter <= OBSERVED[1]:
            text += f" (extrapolated: their D* are {OBSERVED[0]:g} to {OBSERVED[1]:g})"
        bed = self.natural_bed
        if bed is None:
            return f"{text}."
        grains = bed.fraction_of_grains(self.level_shields, SELDOM)
        return f"{text}; gusts move {_bounded(grains, 0.1, 0.9)} of its grains at least 1% of the time."

    def text(self) -> str:
        water, zanke = f"{self.viscosity:.4g} m2/s, {self.fluid_density:.5g} kg/m3", self.zanke
        flow = (
            f"u* = {self.shear_velocity:.4g} m/s{self.source}, bed stress {self.bed_stress:.3g} Pa"
        )
        if self.mean_velocity is not None:
            flow += f", mean velocity {self.mean_velocity:.3g} m/s, Froude number {self.froude:.2g}"
        rows = [
            ("grain", f"{1e3 * self.diameter:g} mm, {self.density:g} kg/m3, D* = {self.dimensionless_diameter:.4g}"),
            ("fluid", water),
            ("flow", flow),
            ("", f"u* d/nu = {self.shear_reynolds:.3g}, {self.regime}"),
            ("Shields number", f"{self.shields:.3g}"),
            ("critical", f"{self.curve:.4f}  Soulsby & Whitehouse (1997); observed beds: 0.45 to 2.4 times this"),
            ("", f"{zanke:.4f}  Zanke (2003)" if zanke else "Zanke (2003): D* is outside his table, 1.2 to 1157"),
            *self._rows_of_bed(),
        ]  # fmt: skip
        if (left := self.slope_factor) <= STEEP:
            on_it = f"on it critical Shields numbers are about {left:.2g} times those above, which are for level beds"
            rows.append(("slope", f"{on_it}; times and answer are for the slope"))
        rows.append(("answer", self.sentence))
        return "\n".join(f"{name:16}{words}" for name, words in rows)

    def _rows_of_bed(self) -> list[tuple[str, str]]:
        bed = self.natural_bed
        if bed is None:
            why = f"u* d/nu = {self.shear_reynolds:.3g} is beyond the computed range, 0 to 300"
            return [("", f"computed natural bed: {why}")]
        rows = [
            ("", f"{bed.median(p):.4f}  computed natural bed, median grain, {100 * p:g}% of the time, "
            f"standard error {100 * bed.error(p):.0f}%")
            for p in (SELDOM, OFTEN)
        ]  # fmt: skip
        error = 1.0 + bed.error(OFTEN)
        least, middle, most = (
            bed.fraction_of_time(self.level_shields * factor)
            for factor in (1.0 / error, 1.0, error)
        )
        limits = 0.001, 0.5
        between = " to ".join(dict.fromkeys(_bounded(end, *limits) for end in (least, most)))
        entrainment = f"entrained {_bounded(middle, *limits)} of the time (within the standard error: {between})"
        return [*rows, ("median grain", entrainment)]

    def as_dict(self) -> dict[str, Any]:
        bed = self.natural_bed
        names = (
            "diameter", "density", "fluid_density", "viscosity", "gravity", "shear_velocity", "depth",
            "mean_velocity", "bed_stress", "shields", "shear_reynolds", "dimensionless_diameter", "froude", "regime",
        )  # fmt: skip
        natural_bed = None if bed is None else {
            "probability": bed.probabilities.tolist(),
            "median": bed.medians.tolist(),
            "standard_error": (bed.errors * bed.medians).tolist(),
        }  # fmt: skip
        return {
            **{name: getattr(self, name) for name in names},
            "critical_shields": {
                "soulsby_whitehouse": self.curve,
                "zanke": self.zanke,
                "natural_bed": natural_bed,
            },
            "observed_beds_that_move": self.observed,
            "entrainment_probability": None
            if bed is None
            else bed.fraction_of_time(self.level_shields),
            "sentence": self.sentence,
        }


def flume(
    diameter: float,
    density: float = 2650.0,
    *,
    shear_velocity: float | None = None,
    depth: float | None = None,
    velocity: float | None = None,
    slope: float | None = None,
    temperature: float = 20.0,
    viscosity: float | None = None,
    fluid_density: float | None = None,
    gravity: float = 9.81,
) -> FlumeAnswer:
    """Determine whether a bed of equal grains moves, from published and computed thresholds.

    Args:
        diameter: of the grains [m].
        density: of the grains [kg/m^3].
        shear_velocity: u* [m/s]; or depth and slope (uniform flow, u*^2 = g h S), or depth and mean velocity.
        depth: of the flow [m].
        velocity: mean over the depth [m/s].
        slope: of bed and surface, rise over length.
        temperature: of water [degrees Celsius], unless viscosity and fluid density are given.
        viscosity: kinematic [m^2/s].
        fluid_density: [kg/m^3].
        gravity: [m/s^2].

    Raises:
        SceneError: a number is outside `RANGES`, or the flow is given twice or not at all.
    """
    flow = {"shear_velocity": shear_velocity, "velocity": velocity, "slope": slope}
    others = {"viscosity": viscosity, "fluid_density": fluid_density, "gravity": gravity}
    grain = {"diameter": diameter, "density": density, "depth": depth}
    numbers = {**grain, **flow, **others, "temperature": temperature}
    for name, value in numbers.items():
        low, high = RANGES[name]
        units = "°C, of liquid water" if name == "temperature" else "in SI units"
        outside = value is not None and not low <= value <= high
        refuse_broken((outside, f"{name}: is {value}; give {low:g} to {high:g} {units}"))
    known = [name for name, value in flow.items() if value is not None]
    inputs = ", ".join(["depth"] * (depth is not None) + known)
    nu = viscosity or viscosity_of_water(temperature)
    water = density_of_water(temperature)
    rho = fluid_density or water
    refuse_broken(
        (
            viscosity is None and abs(rho / water - 1.0) > OF_WATER,
            f"viscosity: is missing; give that of the fluid, whose {rho:g} kg/m3 are not water's",
        ),
        (
            len(known) != 1 or (known != ["shear_velocity"] and depth is None),
            f"flow: is given by {inputs or 'no number'}; give shear_velocity, depth and velocity, or depth and slope",
        ),
        (
            density <= rho,
            f"density: is {density:g}; give that of the grains, above {rho:.5g} kg/m3",
        ),
        (
            depth is not None and depth <= diameter,
            f"depth: is {depth} m, not above diameter, {diameter:g} m; give a larger one",
        ),
    )
    shear, source, mean = shear_velocity or 0.0, "", None
    if depth is not None:
        profile = partial(MeanProfile, viscosity=nu, roughness=ROUGHNESS * diameter, depth=depth)
        if slope is not None:
            shear, source = math.sqrt(gravity * depth * slope), " from depth and slope"
        elif velocity is not None:
            shear, source = _shear_velocity(profile, velocity), " from depth and mean velocity"
        mean = profile(shear).mean
    return FlumeAnswer(
        diameter, density, rho, nu, gravity, shear, depth, mean, source, slope or 0.0
    )


def _shear_velocity(profile: Callable[[float], MeanProfile], velocity: float) -> float:
    low, high = profile(SLOWEST).mean, profile(FASTEST).mean
    outside = f"velocity: is {velocity:g}; give {low:.2g} to {high:.2g} m/s at this depth"
    refuse_broken((not low < velocity < high, outside))
    return float(brentq(lambda u: profile(u).mean - velocity, SLOWEST, FASTEST, rtol=1e-6))


def _bounded(fraction: float, low: float, high: float) -> str:
    if fraction <= low * (1.0 + 1e-6):
        return f"less than {100 * low:g}%"
    if fraction >= high * (1.0 - 1e-6):
        return f"more than {100 * high:g}%"
    return f"{100 * fraction:.2g}%"


def density_of_water(temperature: float) -> float:
    """Density [kg/m^3] at a temperature [degrees Celsius] (Kell 1975, J. Chem. Eng. Data 20, 97)."""
    t = temperature
    upper = 999.83952 + t * (
        16.945176 - t * (7.9870401e-3 + t * (46.170461e-6 - t * (105.56302e-9 - t * 280.54253e-12)))
    )
    return upper / (1.0 + 16.879850e-3 * t)


def viscosity_of_water(temperature: float) -> float:
    """Kinematic viscosity [m^2/s] at a temperature [degrees Celsius] (IAPWS R12-08, equation 37 at 0.1 MPa)."""
    ratio = (temperature + 273.15) / 300.0
    terms = ((280.68, -1.9), (511.45, -7.7), (61.131, -19.6), (0.45903, -40.0))
    dynamic = 1e-6 * sum(factor * ratio**power for factor, power in terms)
    return dynamic / density_of_water(temperature)


# -- the scene that computes one grain of the bed ------------------------------------------------------------


def flume_scene(answer: FlumeAnswer) -> str:
    """TOML scene of one grain in the flow of this shear velocity, for `incipient run`, with its numbers explained.

    The mean velocity of a turbulent flow is adjusted until the developed flow over the rough bed upstream has this u*.
    """
    if answer.shear_reynolds < RESOLVED:
        return _scene_text(answer, answer.shear_velocity)
    velocity = answer.shear_velocity * 8.0
    for _ in range(6):
        reynolds = Setup(loads(_scene_text(answer, velocity))).numbers.shear_reynolds
        assert reynolds is not None
        ratio = answer.shear_reynolds / reynolds
        if abs(ratio - 1.0) < 1e-3:
            break
        velocity *= ratio
    return _scene_text(answer, velocity)


def _scene_text(answer: FlumeAnswer, velocity: float) -> str:
    from jinja2 import StrictUndefined, Template

    depth = SHALLOWEST if answer.depth is None else answer.depth / answer.diameter
    computed = min(max(depth, SHALLOWEST), DEEPEST)
    words = f"of these {computed:.4g} above the crests of the bed"
    if answer.depth is None:
        words += "; the depth of the flume is not known"
    elif computed != depth:
        words += f", of the flume's {depth:.4g}: near the bed u* tells"
    text = files(__package__).joinpath("scene.toml.jinja").read_text(encoding="utf-8")
    template = Template(
        text, trim_blocks=True, keep_trailing_newline=True, undefined=StrictUndefined
    )
    return template.render(
        answer=answer,
        turbulent=answer.shear_reynolds >= RESOLVED,
        rough=answer.shear_reynolds >= IN_LOGARITHMIC_LAYER,
        height=0.866 + computed,  # the crests of the bed are so high
        depth=words,
        velocity=velocity,
    )
