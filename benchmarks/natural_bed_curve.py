"""Critical Shields numbers of the grains of a natural bed in a fluctuating flow: their median and spread.

Loads of each grain are those of its own run or by emulators of the kind of `incipient survey`, fitted anew at each
u* d/nu, with draws of what these cannot tell; its contacts are its own. At one u* d/nu loads over bed stress are
numbers, so that the exact judge gives the critical Shields number by varying the weight. A gust is the mean flow faster
by a factor, at the top of the grain: it loads the grain as the mean flow does whose velocity there is as large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import natural_bed
import numpy as np

from incipient.arrays import Floats, Integers
from incipient.contact.batch import Cases, judge_many
from incipient.contact.friction import FrictionCone
from incipient.setup.base_flow import LAYER, MeanProfile
from incipient.survey.beds import DOWN, Spheres, rolled
from incipient.survey.full_runs import COMPONENTS
from incipient.survey.pockets import Pocket
from incipient.survey.thresholds import FEWEST, FOLDS, SUBMERGED_WEIGHT, Emulator
from incipient.thresholds.laws import Gaussian
from incipient.thresholds.mean_flow import near_wall

EVEN, ODD = [0, 2, 4], [1, 3, 5]  # force along the flow and up, couple about y; the others
DISC, AHEAD, REACH = (
    24,
    2.0,
    0.6,
)  # points across the disc, and lengths over which neighbours shelter [d]
SHARES = (0.1, 0.25, 0.5, 0.75, 0.9)
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
TURBULENT, FEWEST_OF_FACTORS = (
    "k-omega-sst",
    5,
)  # model of runs with turbulence, and how many tell factors
FASTEST = 5000.0  # u* d/nu up to which mean flows are tabulated
LOWEST = 0.1  # height of a top below which the velocity there is that at this height [d]
INTENSITY_OF_WALLS = 0.49  # u'/u next to walls, the limit of the law used


def quantiles(values: Floats, weights: Floats, shares: Sequence[float] = SHARES) -> Floats:
    """The smallest of values (n,) up to which the weights (n,), which sum to one, are a share of all, (m,)."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    places = np.searchsorted(reached, np.asarray(shares) - 1e-12)
    return np.asarray(values[order][np.minimum(places, len(values) - 1)])


@dataclass(frozen=True, eq=False)
class Factors:
    """Load coefficients of grains by those of the same grains in another flow, each times a factor of its own.

    What a factor misses is drawn, its variance as large as the size of the force, or of the couple: runs past grains
    that stand out and that hide differ by less than in proportion to their loads. Loads by the costlier model follow so
    from those by the cheaper one (Kennedy & O'Hagan 2000, Biometrika 87, 1), which few runs tell.

    factors: (6,); spread: (6,) standard deviation of what is missed over the square root of that size; errors: (n, 6)
    of the runs, each without itself
    """

    factors: Floats
    spread: Floats
    errors: Floats

    @classmethod
    def of(cls, lower: Floats, values: Floats) -> Factors:
        """By the loads (n, 6) of n runs in both flows."""
        size = sizes_of(lower)
        both, own = lower * values / size, lower**2 / size
        left_out = (both.sum(axis=0) - both) / (own.sum(axis=0) - own)
        errors = left_out * lower - values
        spread = np.sqrt((errors**2 / size).mean(axis=0))
        return cls(both.sum(axis=0) / own.sum(axis=0), spread, errors)

    def drawn(self, lower: Floats, random: np.random.Generator) -> Floats:
        """Coefficients (n, 6) by those in the other flow, with draws of what these cannot tell."""
        missed = self.spread * np.sqrt(sizes_of(lower))
        return self.factors * lower + missed * random.standard_normal(lower.shape)


def sizes_of(loads: Floats) -> Floats:
    """(n, 6): the sizes of forces, and of couples, of loads (n, 6), for each of their components."""
    sizes = [np.linalg.norm(loads[:, part], axis=1) for part in (slice(0, 3), slice(3, 6))]
    return np.repeat(np.column_stack(sizes), 3, axis=1)


@dataclass(frozen=True, eq=False)
class FlowLoads:
    """Load coefficients of grains at one u* d/nu, by runs past some of them.

    values: (k, 6) of the runs of pockets `numbers`
    below: by the flow before with runs of the same pockets, laminar at the same u* d/nu or at the next lower one;
        None: there is none
    """

    shear_reynolds: float
    model: str
    numbers: tuple[int, ...]
    values: Floats
    below: FlowLoads | None

    def without(self, fold: int, below: FlowLoads | None) -> FlowLoads:
        """The same without about a fifth of the pockets, over a flow `below` without them."""
        kept = [place for place, number in enumerate(self.numbers) if number % FOLDS != fold]
        numbers = tuple(self.numbers[place] for place in kept)
        return FlowLoads(self.shear_reynolds, self.model, numbers, self.values[kept], below)

    @property
    def _lower(self) -> Floats | None:
        """Loads (k, 6) of the same pockets in the flow below."""
        if self.below is None:
            return None
        return self.below.values[[self.below.numbers.index(number) for number in self.numbers]]

    @cached_property
    def factors(self) -> Factors | None:
        """From the flow below to this one with turbulence."""
        lower = self._lower
        return None if lower is None or self.model != TURBULENT else Factors.of(lower, self.values)

    @cached_property
    def emulators(self) -> tuple[Emulator, Emulator]:
        """Of the coefficients that a mirror leaves as they are, and of those that it turns round."""
        known = {one.number: one for one in natural_bed.first_bed()[1]}
        even, odd = self._inputs(features([known[number] for number in self.numbers]), self._lower)
        return Emulator.of(even, self.values[:, EVEN]), Emulator.of(odd, self.values[:, ODD])

    def _inputs(self, known: tuple[Floats, Floats], lower: Floats | None) -> tuple[Floats, Floats]:
        """What emulators go by: features and loads (n, 6) in the flow below, above the viscous layer these alone.

        Of the ways tried it foretells best those runs that were left out.
        """
        if lower is None:
            return known
        if self.shear_reynolds > LAYER:
            return lower[:, EVEN], lower[:, ODD[:1]]
        return np.column_stack([known[0], lower[:, EVEN[:2]]]), np.column_stack(
            [known[1], lower[:, ODD[:1]]]
        )

    @property
    def error(self) -> float:
        """Root mean square error of the drag of runs, each foretold without a fifth of them, over the mean drag."""
        wrong = (self.factors or self.emulators[0]).errors[:, 0]
        return float(np.sqrt((wrong**2).mean()) / self.values[:, 0].mean())

    def drawn(
        self, known: tuple[Floats, Floats], lower: Floats | None, random: np.random.Generator
    ) -> Floats:
        """Coefficients (n, 6) by features and those below, with draws of what these cannot tell."""
        if self.factors is not None and lower is not None:
            return self.factors.drawn(lower, random)
        result = np.empty((len(known[0]), 6))
        for emulator, at, columns in zip(
            self.emulators, self._inputs(known, lower), (EVEN, ODD), strict=True
        ):
            means, deviations = emulator.predicted(at)
            result[:, columns] = means + deviations * random.standard_normal(means.shape)
        return result


def features(grains: Sequence[Pocket]) -> tuple[Floats, Floats]:
    """What emulators know of grains: (n, 4) that a mirror along the flow leaves alone, and (n, 1) that it turns round.

    Protrusion, exposure, shelter down the stream and the speed that comes through to the disc; and by how much nearer
    neighbours above the centre are at one side up the stream and at the other one down it.
    """
    even = [[one.protrusion, one.exposure, one.backed, coming_through(one)] for one in grains]
    return np.array(even), np.array([[askew(one)] for one in grains])


def coming_through(pocket: Pocket) -> float:
    """Mean over the disc across the flow of the height above the bed's mean level [d], without what neighbours hide."""
    side = (np.arange(DISC) + 0.5) / DISC - 0.5
    y, z = (one.ravel() for one in np.meshgrid(side, side))
    y, z = (one[np.hypot(y, z) < 0.5] for one in (y, z))
    near = pocket.neighbours / pocket.diameter
    mine = (near[:, 0] < 0.0) & (near[:, 0] > -AHEAD)
    away = np.hypot(y[:, None] - near[mine, 1], z[:, None] - near[mine, 2])
    hidden = (away < pocket.radii[mine] / pocket.diameter).any(axis=1)
    return float((~hidden * np.maximum(z + pocket.protrusion - 0.5, 0.0)).mean())


def askew(pocket: Pocket) -> float:
    """Sum over neighbours above the centre of n_x n_y exp(-gap/0.6 d), n towards them: odd in y."""
    near = pocket.neighbours / pocket.diameter
    away = np.linalg.norm(near, axis=1)
    gaps = away - 0.5 - pocket.radii / pocket.diameter
    mine = (near[:, 2] > 0.0) & (gaps < AHEAD)
    turned = near[mine, 0] * near[mine, 1] / away[mine] ** 2
    return float((turned * np.exp(-np.maximum(gaps[mine], 0.0) / REACH)).sum())


def flow_loads() -> list[FlowLoads]:
    """Loads by all flows with enough runs: u* d/nu ascending, at each the laminar flow before the turbulent one.

    Loads of runs with turbulence are taken over the velocity at the grain's top, and this over the bed stress as the
    mean profile of the natural bed has it, as in the others.
    """
    by_flow: dict[tuple[float, str], list[dict[str, float]]] = {}
    for row in natural_bed.stored():
        if not row["check"]:
            by_flow.setdefault((row["shear_reynolds"], row["model"]), []).append(row)
    result: list[FlowLoads] = []
    for (level, model), rows in sorted(
        by_flow.items(), key=lambda one: (one[0][0], one[0][1] == TURBULENT)
    ):
        if len(rows) < (FEWEST_OF_FACTORS if model == TURBULENT else FEWEST):
            continue
        numbers = tuple(int(row["pocket"]) for row in rows)
        own = [natural_bed.top_speed(natural_bed.protrusion_of(one), level) for one in numbers]
        scale = (
            (np.array(own) / [row["speed"] for row in rows]) ** 2 if level else np.ones(len(rows))
        )
        values = np.array([[row[name] for name in COMPONENTS] for row in rows]) * scale[:, None]
        lower = [one for one in result if set(numbers) <= set(one.numbers)]
        result.append(FlowLoads(level, model, numbers, values, lower[-1] if lower else None))
    return result


def critical(
    grains: Sequence[Pocket], coefficients: Floats, friction: float = natural_bed.FRICTION
) -> Floats:
    """Critical Shields numbers (n, m) of grains by load coefficients (n, m, 6), infinite where the flow moves none."""
    count = coefficients.shape[1]
    most = max(len(one.contacts.normals) for one in grains)
    normals = np.full((len(grains), most, 3), np.nan)
    for place, one in enumerate(grains):
        normals[place, : len(one.contacts.normals)] = one.contacts.normals
    normals = np.repeat(normals, count, axis=0)
    loads = coefficients.reshape(-1, 6)
    cases = Cases(
        points=0.5 * normals,
        normals=normals,
        force=loads[:, :3],
        torque=loads[:, 3:],
        weight=SUBMERGED_WEIGHT * DOWN,
        centre=np.zeros(3),
        law=FrictionCone.of(friction),
    )
    return judge_many(cases).factors.reshape(len(grains), count)


@dataclass(frozen=True, eq=False)
class MeanFlows:
    """Mean flows past tops of grains at heights (n,) above the bed's mean level [d], and their gusts."""

    heights: Floats
    _known: dict[tuple[float, float, bool], tuple[Floats, Floats]] = field(default_factory=dict)

    @cached_property
    def _speeds(self) -> tuple[Floats, Floats]:
        """Logarithms (k,) of u* d/nu, and (n, k) of the velocity at the tops times d/nu."""
        places = np.geomspace(1e-3, FASTEST, 90)
        speeds = [
            one * MeanProfile(1.0, 1.0 / one, natural_bed.ROUGHNESS, 2.0).speed(self.heights)
            for one in places
        ]
        return np.log(places), np.log(np.array(speeds)).T

    def intensity(self, shear_reynolds: float) -> Floats:
        """u'/u (n,) at the tops: Zanke's law with the height of the top in place of d."""
        if not shear_reynolds:
            return np.full(len(self.heights), INTENSITY_OF_WALLS)
        logarithms, speeds = self._speeds
        velocity = np.array(
            [np.exp(np.interp(math.log(shear_reynolds), logarithms, row)) for row in speeds]
        )
        fluctuation = np.array([near_wall(shear_reynolds * one) for one in self.heights.tolist()])
        return np.asarray(fluctuation * shear_reynolds / velocity)

    def as_fast(self, shear_reynolds: float, factors: Floats) -> Floats:
        """u* d/nu (n,) of the mean flows that at the tops are faster by factors (n,) than that of `shear_reynolds`."""
        logarithms, speeds = self._speeds
        at = math.log(shear_reynolds)
        result = [
            np.interp(np.interp(at, logarithms, row) + more, row, logarithms)
            for row, more in zip(speeds, np.log(factors).tolist(), strict=True)
        ]
        return np.asarray(np.exp(result))

    def gusts(
        self, shear_reynolds: float, probability: float, lognormal: bool
    ) -> tuple[Floats, Floats]:
        """u* d/nu (n,) of mean flows as fast as gusts of a probability, and their bed stress over that of the mean."""
        asked = shear_reynolds, probability, lognormal
        if asked not in self._known:
            factors = factor(self.intensity(shear_reynolds), probability, lognormal)
            # In creeping flow stress goes as velocity.
            faster = (
                self.as_fast(shear_reynolds, factors) if shear_reynolds else np.zeros(len(factors))
            )
            stresses = (faster / shear_reynolds) ** 2 if shear_reynolds else factors
            self._known[asked] = faster, stresses
        return self._known[asked]


@dataclass(frozen=True, eq=False)
class NaturalBed:
    """Grains with critical Shields numbers in steady mean flows, and how probable their motion is in gusts.

    levels: (m,) u* d/nu, ascending from creeping flow, 0; steady: (n, m) critical Shields numbers there
    """

    flows: MeanFlows
    levels: Floats
    steady: Floats

    def at(self, shear_reynolds: Floats) -> Floats:
        """Critical Shields numbers (n,) in steady mean flows, each grain in one of its own u* d/nu (n,)."""
        # Mobility, one over the Shields number, is finite and smooth; beyond the last flow it is that of the last.
        along, places = evenly(np.minimum(shear_reynolds, self.levels[-1])), evenly(self.levels)
        after = np.clip(np.searchsorted(places, along), 1, max(len(places) - 1, 1))
        if len(places) == 1:
            return self.steady[:, 0]
        share = (along - places[after - 1]) / (places[after] - places[after - 1])
        mobility, grains = 1.0 / self.steady, np.arange(len(along))
        result = (1.0 - share) * mobility[grains, after - 1] + share * mobility[grains, after]
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / result)

    def shields(
        self, shear_reynolds: float, probability: float, lognormal: bool = True
    ) -> tuple[Floats, float]:
        """Shields numbers (n,) of the mean flow at which grains are moved at an instant with a probability.

        Also the share of grains whose gusts are faster than any flow that was computed.
        """
        gusts, stresses = self.flows.gusts(shear_reynolds, probability, lognormal)
        beyond = float(np.mean(gusts > self.levels[-1] * (1.0 + 1e-9)))
        return self.at(gusts) / stresses, beyond


def evenly(shear_reynolds: Floats) -> Floats:
    """A coordinate (n,) along which mobility is nearly straight: u* d/nu in the viscous layer, its logarithm above."""
    above = np.maximum(shear_reynolds / LAYER, 1.0)
    return np.asarray(
        np.where(shear_reynolds < LAYER, shear_reynolds, LAYER * (1.0 + np.log(above)))
    )


def factor(intensity: Floats, probability: float, lognormal: bool = True) -> Floats:
    """Factors (n,) on the velocity that are exceeded with a probability, for intensities (n,)."""
    return np.array([Gaussian(one, lognormal).level(probability) for one in intensity.tolist()])


@dataclass(frozen=True, eq=False)
class Sample:
    """The natural bed's grains with all that their Shields numbers come from.

    beds: (n,) which bed each is of; loads: as `flow_loads` gives them
    """

    grains: list[Pocket]
    beds: Integers
    loads: list[FlowLoads]

    @property
    def levels(self) -> dict[float, FlowLoads]:
        """Loads that count at each u* d/nu, ascending: with turbulence where there are such, laminar elsewhere."""
        return {one.shear_reynolds: one for one in self.loads}

    def without(self, fold: int) -> Sample:
        """The same with loads by four fifths of the runs."""
        fewer: dict[FlowLoads, FlowLoads] = {}
        for one in self.loads:
            fewer[one] = one.without(fold, one.below and fewer[one.below])
        return replace(self, loads=[*fewer.values()])

    @cached_property
    def heights(self) -> Floats:
        """(n,) of the tops above the bed's mean level [d]."""
        return np.array([one.protrusion for one in self.grains])

    @cached_property
    def flows(self) -> MeanFlows:
        """Past their tops."""
        return MeanFlows(np.maximum(self.heights, LOWEST))

    @cached_property
    def _features(self) -> tuple[Floats, Floats]:
        return features(self.grains)

    @cached_property
    def _own(self) -> list[tuple[int, int]]:
        """Places of grains that have runs, and the numbers of their pockets."""
        own = {id(one) for one in natural_bed.first_bed()[1]}
        return [(place, one.number) for place, one in enumerate(self.grains) if id(one) in own]

    def coefficients(self, seed: int) -> Floats:
        """Load coefficients (n, m, 6): of a grain with a run its own, of others with draws of what is not known."""
        random, result = np.random.default_rng(seed), dict[FlowLoads, Floats]()
        for loads in self.loads:
            drawn = loads.drawn(self._features, loads.below and result[loads.below], random)
            for place, number in self._own:
                if number in loads.numbers:
                    drawn[place] = loads.values[loads.numbers.index(number)]
            result[loads] = drawn
        return np.stack([result[one] for one in self.levels.values()], axis=1)

    def drawn(self, seed: int, friction: float = natural_bed.FRICTION) -> NaturalBed:
        """The bed by one draw of its loads."""
        steady = critical(self.grains, self.coefficients(seed), friction)
        return NaturalBed(self.flows, np.array([*self.levels]), steady)


def worked(spheres: Spheres, loads: FlowLoads, rounds: int, seed: int = 0) -> Spheres:
    """A bed of equal spheres of which, so many times, the tenth of the free grains that goes first has moved.

    By their critical Shields numbers in `loads`, in a flow along x; each is dropped anew, into the lowest of 8 places.
    """
    random = np.random.default_rng([seed, 5])
    for _ in range(rounds):
        grains = list(natural_bed.free_grains(spheres, 0.0))
        sample = Sample(grains, np.zeros(len(grains), dtype=np.int64), [loads])
        steady = sample.drawn(seed).steady[:, 0]
        first = [
            grains[place].number
            for place in np.argsort(steady)[: round(0.1 * len(grains))].tolist()
        ]
        kept = np.setdiff1d(np.arange(len(spheres)), first)
        spheres = Spheres(spheres.centres[kept], spheres.radii[kept], spheres.period)
        for _ in first:
            spheres = with_another(spheres, random)
    return spheres


def with_another(spheres: Spheres, random: np.random.Generator) -> Spheres:
    """A bed in a periodic box with one more sphere, dropped at 8 places, where it lies lowest."""
    assert spheres.period is not None
    radius = float(spheres.radii[0])
    places = random.random((8, 2)) * spheres.period
    rests = [rolled(spheres, np.array([*place, np.inf]), radius, floor=0.0) for place in places]
    lowest = min(rests, key=lambda rest: float(rest[2]))
    lowest[:2] %= spheres.period
    return Spheres(
        np.vstack([spheres.centres, lowest]), np.append(spheres.radii, radius), spheres.period
    )


def flow_error() -> float:
    """Share by which what runs leave open changes the critical Shields number: the sum of all, the mean of the grains.

    By the stored checks of gap, cells, level ground and domain; the largest of the u* d/nu looked at.
    """
    rows = natural_bed.stored()
    known = {one.number: one for one in natural_bed.first_bed()[1]}

    def shields(row: dict[str, float]) -> float:
        """By the loads of a run."""
        loads = np.array([row[name] for name in COMPONENTS])[None, None]
        return float(critical([known[int(row["pocket"])]], loads)[0, 0])

    changes: dict[tuple[float, int], float] = {}
    for row in rows:
        if row["check"]:
            place = row["shear_reynolds"], int(row["pocket"])
            first = next(
                one
                for one in rows
                if (one["shear_reynolds"], int(one["pocket"]), one["check"]) == (*place, "")
            )
            changes[place] = changes.get(place, 0.0) + abs(shields(row) / shields(first) - 1.0)
    levels = {level for level, _ in changes}
    means = [
        np.mean([value for place, value in changes.items() if place[0] == one]) for one in levels
    ]
    return float(max(means, default=0.0))
