"""Entrainment by random gusts: fraction of time with a velocity at the grain above the critical one.

The velocity is the mean times a random factor of mean 1 (`laws`); the load is that of the steady flow of equal
strength.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ..arrays import SMALLEST
from ..errors import SceneError, refuse_broken
from ..parallel import Comm
from ..progress import Silent
from ..scene.flows import AT_LEAST, MODEL, NEAR_WALL, Gusts
from ..setup.setup import Setup
from .critical import find_threshold
from .laws import (
    Gaussian,
    Law,
    RateOfLasting,
    Record,
    WeakestGusts,
    events,
    measured,
    rate_of_lasting,
    record_of,
)
from .mean_flow import MeanFlow
from .outcome import DOUBTED, Threshold, with_range

PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
WEAKEST, STRONGEST = 1e-3, 1e3  # range of mean flows over the critical one
FARTHEST = 1e6  # largest mean flow over the scene's, and inverse of the least
SOURCES = {
    NEAR_WALL: "from u'/u* near the wall (Zanke 2003)",
    MODEL: "from k of the inflow, u'^2 = 2k/3; values measured near walls are up to 1.3 times as large",
}
FLOW = "flow"  # source of errors


@dataclass(frozen=True)
class OfStrength:
    """Motion in one mean flow.

    strength: of the mean flow over the scene's; shields: its Shields number
    probability: fraction of time in motion
    low, high: its range from threshold and record, and the other law of equal intensity
    rate: upcrossings of the critical strength per unit time; None: not known
    lasting: gusts that move the grain out of its pocket; None: not requested
    """

    strength: float
    shields: float
    probability: float
    rate: float | None
    lasting: RateOfLasting | None
    low: float
    high: float

    def rate_words(self) -> str:
        rate = "not known" if self.rate is None else f"{self.rate:.3g} in unit time"
        return rate if self.lasting is None else f"{rate}, {self.lasting.words()}"


@dataclass(frozen=True)
class Quantile(OfStrength):
    """Motion in the mean flow of a given probability; terms: errors of its Shields number by source."""

    terms: dict[str, float]

    @property
    def error(self) -> float | None:
        return sum(self.terms.values()) if FLOW in self.terms else None

    def line(self) -> str:
        sources = ", ".join(f"{name} {error:.1e}" for name, error in self.terms.items())
        flow = "" if self.error is not None else "; error of the flow not known"
        rate = "" if self.rate is None else f"; {self.rate_words()}"
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
            "schema_version": 1,
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
        steady = with_range(critical.shields, critical.ranges["shields"])
        unknown = "; error of the flow not known" if critical.ranges["shields"] is None else ""
        lines = [
            f"steady flow         moves the grain from Shields number {steady} on, {critical.mode}",
            f"flow of the scene   instantaneous probability of motion {own.probability:.3g} "
            f"({own.low:.3g} to {own.high:.3g}{unknown}); upcrossings: {own.rate_words()}",
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
    ends = 1.0 / FARTHEST, FARTHEST
    refuse_broken(
        (gusts is None, "gusts: is missing; add [gusts] with an intensity, or a measured series"),
        (scene.time is not None, "gusts: are fluctuations of a steady flow; leave [time] out"),
        (
            not all(0.0 < probability < 1.0 for probability in probabilities),
            "probabilities: give one or more, each between 0 and 1",
        ),
        (
            not all(ends[0] <= strength <= ends[1] for strength in strengths),
            f"strengths: give numbers from {ends[0]:g} to {ends[1]:g}",
        ),
    )
    assert gusts is not None
    flow = MeanFlow(setup, gusts)
    flow.require_intensity()  # errors of the input come before any computation
    law = laws_of(gusts, flow)(1.0)
    least, most = law.known_range
    usual = [probability for probability in PROBABILITIES if least <= probability <= most]
    wanted = probabilities or usual or PROBABILITIES
    for probability in wanted:
        law.level(probability)
    if weakest is not None:
        record_of(law, gusts.integral_time)
    threshold = find_threshold(scene, comm, voice)
    if not threshold.is_critical:
        raise SceneError(f"gusts: there is no threshold to exceed; {threshold.sentence}")
    motion = motion_of(gusts, flow, threshold)
    if weakest is not None:
        weakest.require_of(threshold.factor)
        motion = replace(motion, weakest=weakest, integral_time=gusts.integral_time)
    if not strengths:
        low, high = (motion.strength(motion.nearest(end)) for end in (1e-4, 0.99))
        strengths = np.geomspace(low, high, 25).tolist()
    omitted = [] if probabilities else [f"{p:g}" for p in PROBABILITIES if p not in wanted]
    unresolved = "omitted, since the data do not resolve them: probabilities "
    assumed = (
        "the load is that of a steady flow of the gust's strength, with the scene's profile and "
        "without the load of its acceleration",
        *_assumed(gusts, law),
        *([unresolved + ", ".join(omitted)] if omitted else []),
        *([] if weakest is None else weakest.notes()),
        *(note for note in threshold.notes if note.startswith(DOUBTED)),
    )
    return Entrainment(
        scene.title,
        threshold,
        gusts.law,
        motion.at(1.0),
        tuple(motion.quantile(probability) for probability in wanted),
        tuple(motion.at(strength) for strength in strengths),
        assumed,
    )


def laws_of(gusts: Gusts, flow: MeanFlow) -> Callable[[float], Law]:
    """The law of the factor on the velocity, by the strength of the mean flow."""
    if gusts.law in AT_LEAST:
        points, counted_in = np.array(gusts.points), gusts.record
        record = (
            measured(points, gusts.integral_time)
            if counted_in is None
            else events(points, counted_in)
        )
        return lambda strength: record
    lognormal, microscale = gusts.law == "lognormal", gusts.microscale
    return lambda strength: Gaussian(flow.intensity(strength), lognormal, microscale)


def _assumed(gusts: Gusts, law: Law) -> list[str]:
    if isinstance(law, Record):
        return [law.words]
    source = SOURCES.get(str(gusts.intensity), "as given")
    random = f"the velocity over its mean is {gusts.law}, of intensity {law.intensity:.3g} {source}"
    if gusts.microscale is None:
        return [random]
    rice = f"rates are those of a stationary Gaussian process, microscale {law.microscale:.3g} (Rice 1945)"
    return [random, rice]


def motion_of(gusts: Gusts, flow: MeanFlow, threshold: Threshold) -> Motion:
    """Motion by gusts, and its variants: at the ends of the threshold's error bar, and by the other law."""
    motion, bars = Motion(laws_of(gusts, flow), flow.shields, threshold.factor), threshold.bars
    variants: dict[str, list[Motion]] = {}
    if bars is not None and bars.terms:
        ends = (max(end, WEAKEST * motion.factor) for end in (bars.low, bars.high))
        variants[FLOW] = [replace(motion, factor=end) for end in ends]
    if gusts.law not in AT_LEAST:
        law = "normal" if gusts.law == "lognormal" else "lognormal"
        other = laws_of(gusts.model_copy(update={"law": law}), flow)
        variants["law of fluctuations"] = [replace(motion, law=other)]
    return replace(motion, variants=variants)


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the grain in mean flows of any strength over the scene's.

    law: of the factor on the velocity; shields: Shields number; both by the strength
    factor: critical strength
    variants: the same with other assumptions, by source of error
    weakest: gusts that move the grain out of its pocket, with the integral time of generated records
    """

    law: Callable[[float], Law]
    shields: Callable[[float], float]
    factor: float
    variants: Mapping[str, Sequence[Motion]] = field(default_factory=dict)
    weakest: WeakestGusts | None = None
    integral_time: float | None = None

    def at(self, strength: float) -> OfStrength:
        law, probability = self.law(strength), self.probability(strength)
        others = [each.probability(strength) for some in self.variants.values() for each in some]
        spread, lasting = law.spread(probability), None
        low = max(min([probability, *others]) - spread, 0.0)
        high = min(max([probability, *others]) + spread, 1.0)
        if self.weakest is not None:
            record = record_of(law, self.integral_time)
            lasting = rate_of_lasting(record, self.weakest, strength)
        rate = law.upcrossings(self.factor / strength)
        return OfStrength(strength, self.shields(strength), probability, rate, lasting, low, high)

    def quantile(self, probability: float) -> Quantile:
        """The mean flow of a probability of motion, with error bars. Raises SceneError without one."""
        strength = self.strength(probability)
        if math.isinf(strength):
            raise SceneError(
                f"probabilities: {probability:g} is not reached in any mean flow; give another"
            )
        point, spread = self.at(strength), self.law(strength).spread(probability)
        ends = {
            source: [variant.strength(probability) for variant in variants]
            for source, variants in self.variants.items()
        }
        if spread:
            shifted = (self.nearest(probability + sign * spread) for sign in (-1.0, 1.0))
            ends["length of the record"] = [self.strength(end) for end in shifted]
        terms = {
            source: max(abs(self.shields(end) - point.shields) for end in near)
            for source, near in ends.items()
        }
        return Quantile(**vars(point) | {"probability": probability}, terms=terms)

    def probability(self, strength: float) -> float:
        return self.law(strength).exceeded(self.factor / strength)

    def nearest(self, probability: float) -> float:
        least, most = self.law(1.0).known_range
        # A curve ends at ten times the critical flow.
        most = min(most, max(least, self.probability(10.0 * self.factor)))
        return min(max(probability, least), most)

    def strength(self, probability: float) -> float:
        """Mean flow with a probability of motion; infinite without one."""

        def excess(logarithm: float) -> float:
            level = self.law(math.exp(logarithm)).level(probability)
            return logarithm + math.log(max(level, SMALLEST) / self.factor)

        if math.isinf(self.factor):
            return math.inf
        ends = [math.log(end * self.factor) for end in (WEAKEST, STRONGEST)]
        if not excess(ends[0]) < 0.0 < excess(ends[1]):
            return math.inf
        return math.exp(brentq(excess, *ends, xtol=1e-9))
