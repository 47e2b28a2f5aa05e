"""Entrainment by random gusts: fraction of time with a velocity at the grain above the critical one.

The velocity is the mean times a random factor of mean 1 (`laws`); the load is that of the steady flow of equal
strength.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from ..errors import SceneError
from ..parallel import Comm
from ..progress import Silent
from ..scene.flows import GIVEN, MODEL, NEAR_WALL, Gusts
from ..setup.setup import Setup
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
SOURCES = {
    NEAR_WALL: "from u'/u* near the wall (Zanke 2003)",
    MODEL: "from k of the inflow, u'^2 = 2k/3; values measured near walls are up to 1.3 times as large",
}
NO_ERRORS = "ranges of the rates of lasting gusts exclude errors of the weakest gusts, which have no error bars"


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
        series_of(law, gusts.integral_time)
    threshold = find_threshold(scene, comm, voice)
    if not threshold.is_critical:
        raise SceneError(f"gusts: there is no threshold to exceed; {threshold.sentence}")
    if weakest is not None:
        weakest.require_of(threshold.factor)
    motion = Motion(gusts, flow, threshold, threshold.factor, weakest)
    points = tuple(motion.quantile(probability) for probability in wanted)
    if not strengths:
        low, high = (motion.strength(motion.nearest(end)) for end in ENDS)
        strengths = np.geomspace(low, high, ON_CURVE).tolist()
    curve = tuple(motion.at(strength) for strength in strengths)
    assumed = _assumed(gusts, law)
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


def _law_of(gusts: Gusts, flow: MeanFlow, strength: float) -> Law:
    if gusts.record is not None:
        return Events.of(np.array(gusts.points), gusts.record)
    if gusts.law == "measured":
        return Measured.of(np.array(gusts.points), gusts.integral_time)
    return Gaussian(flow.intensity(strength), gusts.law == "lognormal", gusts.microscale)


def _assumed(gusts: Gusts, law: Law) -> list[str]:
    steady = (
        "the load is that of a steady flow of the gust's strength, with the scene's profile and "
        "without the load of its acceleration"
    )
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
    rice = f"rates are those of a stationary Gaussian process, microscale {law.microscale:.3g} (Rice 1945)"
    return [steady, random, rice]


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the grain in mean flows of any strength over the scene's.

    factor: critical strength of the threshold or of an end of its error bar
    other: whether the other law of equal intensity is used
    """

    gusts: Gusts
    flow: MeanFlow
    threshold: Threshold
    factor: float
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
                series = series_of(law, self.gusts.integral_time)
                lasting = rate_of_lasting(series, self.weakest, strength)
            except SceneError:  # no correlation has both times in this mean flow
                lasting = None
        return rate, lasting

    def probability(self, strength: float) -> float:
        return self.law(strength).exceeded(self.factor / strength)

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
