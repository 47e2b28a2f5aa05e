"""Entrainment by random gusts: fraction of time with a velocity at the grain above the critical one.

The velocity is the mean times a random factor of mean 1 (`laws`). The load is that of the steady flow of equal
strength, plus that of the acceleration if the time scales are known.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from ..arrays import Floats
from ..contact import Load, friction
from ..contact.safety import safety_factor
from ..errors import SceneError
from ..parallel import Comm
from ..progress import Silent
from ..scene.gusts import GIVEN, MODEL, NEAR_WALL, Gusts
from ..setup.driving_force import DisplacedFluid
from ..setup.setup import Setup
from ..simulation.build import prepared
from .critical import find_threshold
from .laws import (
    Events,
    Gaussian,
    Law,
    Measured,
    RateOfLasting,
    WeakestGusts,
    rate_of_lasting,
    series_of,
)
from .mean_flow import MeanFlow
from .outcome import DOUBTED, Threshold, with_range

SCHEMA_VERSION = 1
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
ON_CURVE, ENDS = (
    25,
    (1e-4, 0.99),
)  # number of strengths of a default curve, and probabilities at its ends
WEAKEST, STRONGEST = 1e-3, 1e3  # range of mean flows over the critical one
ENOUGH = 10.0  # mean flow over the critical one at the end of a curve
FARTHEST = 1e6  # largest mean flow over the scene's, and inverse of the least
# Equal steps: the critical strength has kinks at changes of mode, which Hermite quadrature misses.
NODES = np.linspace(-4.5, 4.5, 31)  # of the quadrature over the flow's growth, in deviations
WEIGHTS = norm.pdf(NODES) / norm.pdf(NODES).sum()
SOURCES = {
    NEAR_WALL: "from u'/u* near the wall (Zanke 2003)",
    MODEL: "from k of the inflow, u'^2 = 2k/3; values measured near walls are up to 1.3 times as large",
}
NO_ERRORS = "ranges of the rates of lasting gusts exclude errors of the weakest gusts, which have no error bars"
ACCELERATION = "acceleration acts through added mass and pressure gradient, without viscosity; rates neglect it"
RANGE = (
    20.0  # of the search for a critical strength: factor on that of a steady flow, and its inverse
)
LARGEST_LOGARITHM = 5.0  # of a safety factor in a root search
APART = 1.03  # ratio of growths between which critical strengths are interpolated


@dataclass(frozen=True)
class InMeanFlow:
    """Motion in one mean flow.

    strength: of the mean flow over the scene's; shields: its Shields number
    probability: fraction of time in motion
    rate: upcrossings of the critical strength per unit time; None: not known
    lasting: gusts that move the grain out of its pocket; None: not requested
    """

    strength: float
    shields: float
    probability: float
    rate: float | None
    lasting: RateOfLasting | None


@dataclass(frozen=True)
class OfStrength(InMeanFlow):
    """Motion in a given mean flow.

    low, high: range of the probability from threshold and series, and the other law of equal intensity
    """

    low: float
    high: float


@dataclass(frozen=True)
class Quantile(InMeanFlow):
    """Motion in the mean flow of a given probability; terms: errors of its Shields number by source."""

    terms: dict[str, float]

    @property
    def error(self) -> float | None:
        return sum(self.terms.values()) if "flow" in self.terms else None

    def line(self) -> str:
        sources = ", ".join(f"{name} {error:.1e}" for name, error in self.terms.items())
        rate = "" if self.rate is None else f"; {self.rate:.3g} in unit time"
        if self.lasting is not None:
            rate += f", {self.lasting.words()}"
        flow = "" if self.error is not None else "; error of the flow not known"
        ends = self.error and (self.shields - self.error, self.shields + self.error)
        shown = f"Shields number {with_range(self.shields, ends or None)}"
        return f"{self.probability:>8.3g}  {shown}, {self.strength:.4g} times the flow ({sources}){flow}{rate}"


@dataclass(frozen=True)
class Entrainment:
    """The probability of motion.

    law: of the factor of the velocity; scene: motion in the scene's own mean flow
    quantiles: mean flows of given probabilities; curve: motion in weak to strong mean flows
    assumed: assumptions, one line each
    """

    title: str
    threshold: Threshold
    law: str
    scene: OfStrength
    quantiles: tuple[Quantile, ...]
    curve: tuple[OfStrength, ...]
    assumed: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        named = ("factor", "shields", "shear_reynolds", "mode", "ranges")
        return {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "law": self.law,
            "threshold": {name: getattr(self.threshold, name) for name in named},
            "scene": asdict(self.scene),
            "quantiles": [{**asdict(point), "error": point.error} for point in self.quantiles],
            "curve": [asdict(point) for point in self.curve],
            "assumed": list(self.assumed),
        }

    def text(self) -> str:
        critical, own = self.threshold, self.scene
        rate = "not known" if own.rate is None else f"{own.rate:.3g} times in unit time"
        if own.lasting is not None:
            rate += f", {own.lasting.words()}"
        steady = with_range(critical.shields, critical.ranges["shields"])
        unknown = "; error of the flow not known" if critical.ranges["shields"] is None else ""
        lines = [
            f"steady flow         moves the grain from Shields number {steady} on, {critical.mode}",
            f"flow of the scene   instantaneous probability of motion {own.probability:.3g} "
            f"({own.low:.3g} to {own.high:.3g}{unknown}); upcrossings: {rate}",
            "instantaneous probability of motion, and the mean flow",
            *(point.line() for point in self.quantiles),
            *(f"assumed             {line}" for line in self.assumed),
        ]
        return "\n".join(lines)


def find_entrainment(
    setup: Setup,
    comm: Comm,
    probabilities: Sequence[float] = (),
    strengths: Sequence[float] = (),
    weakest: WeakestGusts | None = None,
    voice: Silent | None = None,
) -> Entrainment:
    """Find the probability of motion in the scene's flow with its [gusts], and in stronger and weaker ones. Collective.

    Args:
        setup: of a grain that rests on a bed, in a steady flow, with [gusts].
        probabilities: for which mean flows are computed; default: `PROBABILITIES` within the range of the data.
        strengths: mean flows over the scene's, for which probabilities are computed.
        weakest: weakest gusts that move the grain out of its pocket, for their rate.

    Raises:
        SceneError: the scene has no gusts or no threshold; a probability is outside the range of a measured series.
    """
    scene, gusts = setup.scene, setup.scene.gusts
    if gusts is None:
        raise SceneError("gusts: is missing; add [gusts] with an intensity, or a measured series")
    if scene.time is not None:
        raise SceneError("gusts: are fluctuations of a steady flow; leave [time] out")
    if not all(0.0 < probability < 1.0 for probability in probabilities):
        raise SceneError("probabilities: give one or more, each between 0 and 1")
    if not all(1.0 / FARTHEST <= strength <= FARTHEST for strength in strengths):
        raise SceneError(f"strengths: give numbers from {1.0 / FARTHEST:g} to {FARTHEST:g}")
    flow = MeanFlow(setup, gusts)
    flow.require_intensity()  # errors of the input come before any computation
    law = _law_of(gusts, flow, 1.0)
    least, most = law.known_range
    usual = [probability for probability in PROBABILITIES if least <= probability <= most]
    wanted = probabilities or usual or PROBABILITIES
    for probability in wanted:
        law.level(probability)
    if weakest is not None:
        series_of(law, flow.integral_time(1.0))
    threshold = find_threshold(scene, comm, voice)
    if not threshold.is_critical:
        raise SceneError(f"gusts: there is no threshold to exceed; {threshold.sentence}")
    if weakest is not None:
        weakest.require_of(threshold.factor)
    assert scene.contact is not None
    growing, without = None, _without_growth(setup, gusts, threshold)
    if not without:
        growth = load_of_growth(setup, comm)
        growing = CriticalStrength(threshold, growth, scene.contact.law)
    motion = Motion(gusts, flow, threshold, threshold.factor, growing, weakest)
    points = tuple(motion.quantile(probability) for probability in wanted)
    if not strengths:
        low, high = (motion.strength(motion.nearest(end)) for end in ENDS)
        strengths = np.geomspace(low, high, ON_CURVE).tolist()
    curve = tuple(motion.at(strength) for strength in strengths)
    assumed = [*_assumed(gusts, law), without or ACCELERATION]
    if left_out := [
        probability
        for probability in PROBABILITIES
        if not probabilities and probability not in wanted
    ]:
        missing = ", ".join(f"{probability:g}" for probability in left_out)
        assumed.append(f"omitted, since the data do not resolve them: probabilities {missing}")
    if weakest is not None and not weakest.known:
        assumed.append(NO_ERRORS)
    assumed += [note for note in threshold.notes if note.startswith(DOUBTED)]
    own, title = motion.at(1.0), scene.title
    return Entrainment(title, threshold, gusts.law, own, points, curve, tuple(assumed))


def _without_growth(setup: Setup, gusts: Gusts, threshold: Threshold) -> str:
    reasons = (
        (gusts.law in GIVEN, "the data are treated as slowly varying"),
        (gusts.microscale is None, "gusts.microscale is not given"),
        (setup.is_averaged, "it is computed in laminar flow only"),
        (
            not math.isfinite(threshold.steepness or math.inf),
            "the safety factor jumps at the threshold",
        ),
    )
    why = next((reason for applies, reason in reasons if applies), "")
    return why and f"the load of the flow's acceleration is neglected: {why}"


def _law_of(gusts: Gusts, flow: MeanFlow, strength: float) -> Law:
    if gusts.record is not None:
        return Events.of(np.array(gusts.points), gusts.record)
    if gusts.law == "measured":
        return Measured.of(np.array(gusts.points), flow.integral_time(1.0))
    return Gaussian(flow.intensity(strength), gusts.law == "lognormal", flow.microscale(strength))


def _assumed(gusts: Gusts, law: Law) -> list[str]:
    steady = "the load is that of a steady flow of the gust's strength, with the scene's profile"
    if isinstance(law, Measured):
        known = f"intensity {law.intensity:.3g}, integral time {law.integral:.3g}, {law.independent:.0f} samples"
        series = f"the velocity over its mean follows the series in all mean flows: {known}"
        return [steady, series]
    if isinstance(law, Events):
        known = f"{len(law.strengths)} in a time of {law.duration:g}, without motion between them"
        events = (
            f"the gusts relative to the mean velocity are those counted, in all mean flows: {known}"
        )
        return [steady, events]
    source = SOURCES.get(str(gusts.intensity), "as given")
    random = f"the velocity over its mean is {gusts.law}, of intensity {law.intensity:.3g} {source}"
    if gusts.microscale is None:
        return [steady, random]
    scale = (
        f"microscale {law.microscale:.3g}{', by the model' if gusts.microscale == MODEL else ''}"
    )
    rice = f"rates are those of a stationary Gaussian process, {scale} (Rice 1945)"
    return [steady, random, rice]


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the grain in mean flows of any strength over the scene's.

    factor: critical strength of the threshold or of an end of its error bar
    growing: critical strengths of a growing flow; None: growth is omitted
    other: whether the other law of equal intensity is used
    """

    gusts: Gusts
    flow: MeanFlow
    threshold: Threshold
    factor: float
    growing: CriticalStrength | None = None
    weakest: WeakestGusts | None = None
    other: bool = False

    @cached_property
    def _data(self) -> Measured | Events | None:
        law = _law_of(self.gusts, self.flow, 1.0) if self.gusts.law in GIVEN else None
        return None if isinstance(law, Gaussian) else law

    def law(self, strength: float) -> Law:
        law = self._data or _law_of(self.gusts, self.flow, strength)
        return law.other() if self.other and isinstance(law, Gaussian) else law

    @cached_property
    def _within_bars(self) -> list[Motion]:
        bars = self.threshold.bars
        if bars is None or not bars.terms:
            return []
        least = WEAKEST * self.threshold.factor
        return [replace(self, factor=max(end, least)) for end in (bars.low, bars.high)]

    def at(self, strength: float) -> OfStrength:
        variants = [*self._within_bars, *([] if self._data else [replace(self, other=True)])]
        probability = self.probability(strength)
        ranges = [probability, *(variant.probability(strength) for variant in variants)]
        spread = self._data.spread(probability) if self._data else 0.0
        low, high = max(min(ranges) - spread, 0.0), min(max(ranges) + spread, 1.0)
        shields = self.flow.shields(strength)
        return OfStrength(strength, shields, probability, *self._rates(strength), low, high)

    def quantile(self, probability: float) -> Quantile:
        """The mean flow of a probability of motion, with error bars. Raises SceneError without one."""
        strength, terms = self.strength(probability), dict[str, float]()
        if math.isinf(strength):
            why = f"{probability:g} is not reached in any mean flow"
            raise SceneError(f"probabilities: {why}; give another")
        shields = self.flow.shields(strength)

        def change(others: Iterable[float]) -> float:
            return max(abs(self.flow.shields(other) - shields) for other in others)

        if self._within_bars:
            terms["flow"] = change(end.strength(probability) for end in self._within_bars)
        if self._data is None:
            other = replace(self, other=True).strength(probability)
            terms["law of fluctuations"] = change([other])
        else:
            spread = self._data.spread(probability)
            ends = [self.nearest(probability + sign * spread) for sign in (-1.0, 1.0)]
            terms["length of the record"] = change(map(self.strength, ends))
        return Quantile(strength, shields, probability, *self._rates(strength), terms)

    def _rates(self, strength: float) -> tuple[float | None, RateOfLasting | None]:
        law = self.law(strength)
        rate, lasting = law.upcrossings(self.factor / strength), None
        if self.weakest is not None:
            try:
                series = series_of(law, self.flow.integral_time(strength))
                lasting = rate_of_lasting(series, self.weakest, strength)
            except SceneError:  # no correlation has both times in this mean flow
                lasting = None
        return rate, lasting

    def probability(self, strength: float) -> float:
        law, growing = self.law(strength), self.growing
        if math.isinf(self.factor):
            return 0.0
        if growing is None or not isinstance(law, Gaussian) or law.microscale is None:
            return law.exceeded(self.factor / strength)
        # The rate of the Gaussian process is independent of it, of variance 2/lambda^2.
        rate = law.growth(strength) * math.sqrt(2.0) / law.microscale
        over = self.factor / self.threshold.factor / strength
        exceeded = [
            law.exceeded(over * growing.near(node * rate, law.lognormal)) for node in NODES.tolist()
        ]
        return float(WEIGHTS @ exceeded)

    def nearest(self, probability: float) -> float:
        least, most = self.law(1.0).known_range
        most = min(most, max(least, self.probability(ENOUGH * self.factor)))
        return min(max(probability, least), most)

    def strength(self, probability: float) -> float:
        """Mean flow with a probability of motion; infinite without one."""
        if math.isinf(self.factor):
            return math.inf
        if self._data is not None:
            level = self._data.level(probability)
            return self.factor / level if level > 0.0 else math.inf

        def excess(logarithm: float) -> float:
            return _standard(self.probability(math.exp(logarithm))) - _standard(probability)

        ends = [math.log(end * self.factor) for end in (WEAKEST, STRONGEST)]
        if not excess(ends[0]) < 0.0 < excess(ends[1]):
            return math.inf
        return math.exp(brentq(excess, *ends, xtol=1e-9))


def _standard(probability: float) -> float:
    return float(norm.ppf(min(max(probability, 1e-300), 1.0 - 1e-15)))


# -- load of acceleration -------------------------------------------------------------------------------------


def load_of_growth(setup: Setup, comm: Comm) -> Floats:
    """Force and torque (6,) about the centroid for growth by the scene's flow in unit time. Collective.

    Inviscid: pressure gradient on the displaced fluid, and potential disturbance.
    """
    from ..coupled.added_mass import load_of_disturbance

    scene, base_flow = setup.scene, setup.base_flow
    assert scene.grain is not None
    with prepared(scene, comm) as run:
        placement = run.layout.placement
        assert placement is not None
        bottom, outlet = setup.sides.around[:2]
        walls = ["body", *([bottom] if scene.bed is not None else [])]
        disturbance = load_of_disturbance(
            run.domain, lambda x: base_flow.velocity(x, 0.0), walls, outlet, placement.centre
        )
    return np.ravel(disturbance + DisplacedFluid(scene.grain, base_flow).load(placement))


@dataclass(frozen=True, eq=False)
class CriticalStrength:
    """Critical strength of a growing or fading flow. Near the critical flow the load is a power of the strength.

    of_growth: (6,) load at growth of the strength by one in unit time
    """

    threshold: Threshold
    of_growth: Floats
    law: friction.Law
    _known: dict[tuple[float, bool], float] = field(default_factory=dict)

    def near(self, growth: float, relative: bool) -> float:
        """As `at`, interpolated between neighbours for an absolute growth, which differs between mean flows."""
        if relative or not growth:
            return self.at(growth, relative)
        below = APART ** math.floor(math.log(abs(growth)) / math.log(APART))
        ends = [below, APART * below]
        known = [self.at(math.copysign(end, growth), False) for end in ends]
        return float(np.interp(abs(growth), ends, known))

    def at(self, growth: float, relative: bool) -> float:
        """Critical strength at growth in unit time by `growth` times the scene's flow, or its own if `relative`."""
        key = (float(f"{growth:.8g}"), relative)
        if key not in self._known:
            self._known[key] = self._solved(*key)
        return self._known[key]

    def _solved(self, growth: float, relative: bool) -> float:
        factor = self.threshold.factor
        low, high = factor / RANGE, factor * RANGE
        if self._logarithm(low, growth, relative) <= 0.0:
            return low
        if self._logarithm(high, growth, relative) >= 0.0:
            return high
        return float(brentq(self._logarithm, low, high, args=(growth, relative), xtol=1e-8 * low))

    def _logarithm(self, strength: float, growth: float, relative: bool) -> float:
        threshold = self.threshold
        assert threshold.steepness is not None
        steady, ratio = threshold.load, (strength / threshold.factor) ** threshold.steepness
        added = growth * (strength if relative else 1.0) * self.of_growth
        force, torque = ratio * steady.flow_force, ratio * steady.flow_couple
        load = Load(force + added[:3], torque + added[3:], steady.weight, steady.centre)
        value = safety_factor(load, threshold.contacts, self.law).value
        bound = math.exp(LARGEST_LOGARITHM)
        return math.log(min(max(value, 1.0 / bound), bound))
