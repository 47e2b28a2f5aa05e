"""Entrainment by gusts of chance: how often the velocity at a grain exceeds the one that moves it.

The velocity at the grain is the mean times a random factor of mean one (`laws`), so the grain is moved at instants at
which the factor is above the critical strength of the scene's flow over that of the mean flow. The load is that of
the steady flow as strong (`critical`), and, where the flow's changes are known in time, that of their acceleration
(`sudden`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from ..arrays import Floats
from ..critical.outcome import DOUBTED, Threshold
from ..critical.threshold import find_threshold
from ..errors import SceneError
from ..parallel import Comm
from ..planning.flow_setup import Setup
from ..progress import Silent
from ..scene.fluctuations import GIVEN, MODEL, NEAR_WALL, Gusts
from .lasting import Course, RateOfLasting, WeakestGusts, rate_of_lasting
from .laws import Data, Events, Gaussian, Law, Measured
from .outcome import Entrainment, OfStrength, Quantile
from .stream import Stream
from .sudden import CriticalStrength, load_of_growth

PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
ON_CURVE, ENDS = (
    25,
    (1e-4, 0.99),
)  # strengths of a curve without given ones, and probabilities between which they are
WEAKEST, STRONGEST = (
    1e-3,
    1e3,
)  # mean flows over the critical one, between which probabilities are looked for
ENOUGH = 10.0  # mean flow over the critical one in which a curve ends
FARTHEST = 1e6  # mean flow over the scene's, or its inverse, that may be asked for
APART = 1.03  # of growths at which critical strengths are found
NODES, OUTERMOST = (
    31,
    4.5,
)  # of the quadrature over the flow's growth, and how many deviations out it goes


def find_entrainment(
    setup: Setup,
    comm: Comm,
    probabilities: Sequence[float] = (),
    strengths: Sequence[float] = (),
    weakest: WeakestGusts | None = None,
    voice: Silent | None = None,
) -> Entrainment:
    """Find how probable motion is in the scene's flow with its [gusts], and in stronger and weaker ones. Collective.

    Args:
        setup: of a grain that rests on a bed, in a steady flow, with [gusts].
        probabilities: of motion at an instant, for which the mean flow is found; default: `PROBABILITIES`, of those
            what the data can tell.
        strengths: mean flows over the scene's, for which the probability is found; default: some that show the curve.
        weakest: gusts that move the grain out of its pocket; then the rate of those as strong is found, too.

    Raises:
        SceneError: the scene has no gusts or no threshold; a measured series cannot tell a probability.
    """
    scene, gusts = setup.scene, setup.scene.gusts
    if gusts is None:
        raise SceneError("gusts: is missing; add [gusts] with an intensity, or a measured series")
    _require(probabilities, strengths)
    stream = Stream(setup, gusts)
    stream.require_intensity()  # what is wrong is said before anything is computed
    law = _law_of(gusts, stream, 1.0)
    asked = probabilities or _told(law)
    for one in asked:
        law.level(one)
    if weakest is not None:
        Course.of(law, stream.integral_time(1.0))
    threshold = find_threshold(scene, comm, voice)
    if not threshold.is_critical:
        raise SceneError(f"gusts: there is no threshold to exceed; {threshold.why_none()}")
    if weakest is not None:
        weakest.require_of(threshold.factor)
    growth, without_growth = None, _without_growth(setup, gusts, threshold)
    if not without_growth:
        growth = load_of_growth(setup, comm)
    assert scene.contact is not None
    motion = Motion(gusts, stream, threshold, growth, scene.contact.friction, weakest)
    points = tuple(motion.quantile(one) for one in asked)
    chosen = strengths or _for_curve(motion)
    curve = tuple(motion.at(one) for one in chosen)
    assumed = (
        *_assumed(motion, without_growth),
        *_left_out(asked, probabilities),
        *_without_errors(weakest),
    )
    assumed += tuple(note for note in threshold.notes if note.startswith(DOUBTED))
    return Entrainment(scene.title, threshold, gusts.law, motion.at(1.0), points, curve, assumed)


def _require(probabilities: Sequence[float], strengths: Sequence[float]) -> None:
    if not all(0.0 < one < 1.0 for one in probabilities):
        raise SceneError("probabilities: give one or more, each between 0 and 1")
    if not all(1.0 / FARTHEST <= one <= FARTHEST for one in strengths):
        raise SceneError(f"strengths: give numbers from {1.0 / FARTHEST:g} to {FARTHEST:g}")


def _told(law: Law) -> Sequence[float]:
    """The usual probabilities; those that data can tell, if there are some."""
    if isinstance(law, Gaussian):
        return PROBABILITIES
    least, most = law.told
    return [one for one in PROBABILITIES if least <= one <= most] or PROBABILITIES


def _left_out(asked: Sequence[float], given: Sequence[float]) -> list[str]:
    """A line on the usual probabilities that the data cannot tell."""
    missing = ", ".join(f"{one:g}" for one in PROBABILITIES if not given and one not in asked)
    return (
        [f"left out, since the data cannot tell them: probabilities {missing}"] if missing else []
    )


def _without_errors(weakest: WeakestGusts | None) -> list[str]:
    """A line on a curve of the weakest gusts that has no error bars."""
    if weakest is None or weakest.known:
        return []
    return [
        "ranges of the rates of gusts that last hold no error of the weakest gusts, searched without error bars"
    ]


def _without_growth(setup: Setup, gusts: Gusts, threshold: Threshold) -> str:
    """Why the load of the flow's growth is left out; empty where it is known."""
    if gusts.law in GIVEN:
        return (
            "the load of the flow's acceleration is left out: the data are taken as of slow changes"
        )
    if gusts.microscale is None:
        return "the load of the flow's acceleration is left out: gusts.microscale is not given"
    if setup.is_averaged:
        return (
            "the load of the flow's acceleration is left out: it is computed in laminar flow only"
        )
    if threshold.steepness is None or not math.isfinite(threshold.steepness):
        return "the load of the flow's acceleration is left out: the safety factor jumps at the threshold"
    return ""


def _law_of(gusts: Gusts, stream: Stream, strength: float) -> Law:
    """The law of the factor in a mean flow of a strength."""
    if gusts.record is not None:
        return Events.of(np.array(gusts.points), gusts.record)
    if gusts.law == "measured":
        return Measured.of(np.array(gusts.points), stream.integral_time(1.0))
    return Gaussian(
        stream.intensity(strength), gusts.law == "lognormal", stream.microscale(strength)
    )


def _for_curve(motion: Motion) -> list[float]:
    low, high = (motion.strength(one, clipped=True) for one in ENDS)
    return [float(one) for one in np.geomspace(low, high, ON_CURVE)]


def _assumed(motion: Motion, without_growth: str) -> list[str]:
    """What is assumed, in one line each."""
    gusts, law = motion.gusts, motion.law(1.0)
    lines = [
        "the load is that of the steady flow as strong as the gust, of the scene's own profile"
    ]
    if isinstance(law, Measured):
        known = f"intensity {law.intensity:.3g}, integral time {law.integral:.3g}, {law.independent:.0f} samples"
        lines.append(f"the velocity over its mean is as in the series in all mean flows: {known}")
        return [*lines, without_growth]
    if isinstance(law, Events):
        known = f"{len(law.strengths)} in a time of {law.duration:g}, and nothing moves the grain between them"
        lines.append(
            f"the gusts over the mean velocity are those counted, in all mean flows: {known}"
        )
        return [*lines, without_growth]
    how = {
        NEAR_WALL: "by u'/u* near the wall (Zanke 2003)",
        MODEL: "by k of the model as it enters, u'^2 = 2k/3; measured ones near walls are up to 1.3 times that",
    }
    source = how.get(str(gusts.intensity), "as given")
    lines.append(
        f"the velocity over its mean is {gusts.law}, of intensity {law.intensity:.3g} {source}"
    )
    if gusts.microscale is None:
        return [*lines, without_growth]
    scale = (
        f"microscale {law.microscale:.3g}{', by the model' if gusts.microscale == MODEL else ''}"
    )
    lines.append(f"rates are those of a stationary Gaussian process, {scale} (Rice 1945)")
    if without_growth:
        return [*lines, without_growth]
    return [
        *lines,
        "acceleration acts by added mass and pressure gradient, without viscosity; in rates it is left out",
    ]


class Motion:
    """Motion of the grain in mean flows of all strengths, over the scene's. No method is collective.

    Args:
        growth: (6,) load where the scene's flow grows by itself in unit time; None: it is left out.
    """

    def __init__(
        self,
        gusts: Gusts,
        stream: Stream,
        threshold: Threshold,
        growth: Floats | None,
        friction: float,
        weakest: WeakestGusts | None = None,
    ):
        self._weakest = weakest
        self.gusts, self.stream, self.threshold = gusts, stream, threshold
        self._critical = (
            None if growth is None else CriticalStrength.of(threshold, growth, friction)
        )
        # The critical strength has kinks where the mode changes: equal steps miss less of them than those of Hermite.
        nodes = np.linspace(-OUTERMOST, OUTERMOST, NODES)
        weights = norm.pdf(nodes)
        self._growths = list(zip(nodes.tolist(), (weights / weights.sum()).tolist(), strict=True))
        self._levels: dict[tuple[float, bool], float] = {}
        law = _law_of(gusts, stream, 1.0)
        self._measured = law if isinstance(law, Data) else None

    def law(self, strength: float) -> Law:
        """The law of the factor in a mean flow."""
        return self._measured or _law_of(self.gusts, self.stream, strength)

    def at(self, strength: float) -> OfStrength:
        """Probability and rate of motion in a mean flow."""
        law, factor = self.law(strength), self.threshold.factor
        found = self.probability(strength, law)
        ranges = [self.probability(strength, law, one / factor) for one in self._bounds()]
        if isinstance(law, Gaussian):
            ranges.append(self.probability(strength, law.other()))
        spread = law.spread(found)
        low, high = min([*ranges, found]) - spread, max([*ranges, found]) + spread
        rate = law.upcrossings(factor / strength)
        shields = self.stream.shields(strength)
        within = max(low, 0.0), min(high, 1.0)
        return OfStrength(strength, shields, found, *within, rate, self._lasting(strength, law))

    def quantile(self, probability: float) -> Quantile:
        """The mean flow in which motion has a probability at an instant, with its error bars."""
        strength = self.strength(probability)
        shields, law = self.stream.shields(strength), self.law(strength)
        terms: dict[str, float] = {}
        bounds = self._bounds()
        if bounds:
            ends = [self.strength(probability, share=one / self.threshold.factor) for one in bounds]
            terms["flow"] = max(abs(self.stream.shields(one) - shields) for one in ends)
        if isinstance(law, Gaussian):
            other = self.strength(probability, other=True)
            terms["law of fluctuations"] = abs(self.stream.shields(other) - shields)
        else:
            spread = law.spread(probability)
            ends = [
                self.strength(probability + sign * spread, clipped=True) for sign in (-1.0, 1.0)
            ]
            terms["length of the record"] = max(
                abs(self.stream.shields(one) - shields) for one in ends
            )
        rate = law.upcrossings(self.threshold.factor / strength)
        return Quantile(probability, strength, shields, terms, rate, self._lasting(strength, law))

    def _lasting(self, strength: float, law: Law) -> RateOfLasting | None:
        """The rate of gusts that last long enough, where they are known, and a correlation has both times there."""
        if self._weakest is None:
            return None
        try:
            course = Course.of(law, self.stream.integral_time(strength))
        except SceneError:
            return None
        return rate_of_lasting(course, self._weakest, strength)

    def probability(self, strength: float, law: Law, share: float = 1.0) -> float:
        """Probability of motion at an instant in a mean flow; `share`, even infinite, multiplies what is critical."""
        if math.isinf(share):
            return 0.0
        if self._critical is None or not isinstance(law, Gaussian) or law.microscale is None:
            return law.exceeded(share * self.threshold.factor / strength)
        # The rate of the Gaussian process is independent of it, of variance 2/lambda^2.
        rate, found = law.growth(strength) * math.sqrt(2.0) / law.microscale, 0.0
        for node, weight in self._growths:
            level = share * self._critical_at(node * rate, law.lognormal) / strength
            found += weight * law.exceeded(level)
        return found

    def _critical_at(self, growth: float, relative: bool) -> float:
        """The critical strength; over growths that are not relative it is straight between some a factor apart.

        These change with every mean flow, relative ones hardly.
        """
        if relative or not growth:
            return self._solved_at(growth, relative)
        below = APART ** math.floor(math.log(abs(growth)) / math.log(APART))
        ends = [
            self._solved_at(math.copysign(one, growth), False) for one in (below, APART * below)
        ]
        return float(np.interp(abs(growth), [below, APART * below], ends))

    def _solved_at(self, growth: float, relative: bool) -> float:
        assert self._critical is not None
        key = (float(f"{growth:.8g}"), relative)
        if key not in self._levels:
            self._levels[key] = self._critical.at(*key)
        return self._levels[key]

    def strength(
        self, probability: float, share: float = 1.0, other: bool = False, clipped: bool = False
    ) -> float:
        """The mean flow in which motion has a probability.

        share: multiplies the critical strength; infinite: so is the mean flow
        other: with the other law of the same intensity; infinite where that reaches it in no mean flow
        clipped: or with the nearest probability that data can tell, and that a flow of `ENOUGH` has
        """
        critical = share * self.threshold.factor
        if math.isinf(share):
            return math.inf
        if self._measured is not None:
            if clipped:
                least, most = self._measured.told
                most = min(most, max(least, self._measured.exceeded(1.0 / ENOUGH)))
                probability = min(max(probability, least), most)
            level = self._measured.level(probability)
            if not level > 0.0:
                raise _not_reached(probability)
            return critical / level
        if clipped:
            probability = min(
                probability, self.probability(ENOUGH * critical, self.law(ENOUGH * critical), share)
            )

        def excess(logarithm: float) -> float:
            """Probability in a mean flow beyond that wanted, in standard deviations of a Gaussian."""
            strength = math.exp(logarithm)
            law = self.law(strength)
            law = law.other() if other and isinstance(law, Gaussian) else law
            return _standard(self.probability(strength, law, share)) - _standard(probability)

        ends = [math.log(one * critical) for one in (WEAKEST, STRONGEST)]
        if not excess(ends[0]) < 0.0 < excess(ends[1]):
            if other:
                return math.inf
            raise _not_reached(probability)
        return math.exp(brentq(excess, *ends, xtol=1e-9))

    def _bounds(self) -> list[float]:
        bars = self.threshold.bars
        if bars is None or not bars.terms:
            return []
        return [max(one, WEAKEST * self.threshold.factor) for one in (bars.low, bars.high)]


def _not_reached(probability: float) -> SceneError:
    return SceneError(
        f"probabilities: {probability:g} is not reached in any mean flow; give another"
    )


def _standard(probability: float) -> float:
    """The Gaussian variable of variance one below which a share of the probability is."""
    return float(norm.ppf(min(max(probability, 1e-300), 1.0 - 1e-15)))
