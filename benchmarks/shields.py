"""Shields' curve from computed flows: a natural bed and single beads in a fluctuating flow, compared with flumes.

The natural bed: grains of random beds by their own contacts (natural_bed.py), loads by full runs and an emulator
(natural_bed_curve.py). Thresholds of the beads are those of beads.csv, in the linear profile next to a bed. The
fluctuation is lognormal, of the intensity near walls of `incipient.entrainment`. Nothing is fitted. Beside them: 511
observations in flumes, a balance of forces by Monte Carlo with assumed drag, lift and protrusion, Zanke's curve,
Soulsby & Whitehouse's.

Cost:    five minutes; the natural bed's flows an hour (natural_bed.py), the beads' an hour and a half (beads.py).
Run:     python benchmarks/shields.py
Results: docs/figures/shields.webp, docs/validation/shields.csv, incipient/flumes/natural_bed.csv
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import product
from pathlib import Path

import natural_bed
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from natural_bed_curve import (
    SHARES,
    FlowLoads,
    NaturalBed,
    Sample,
    flow_error,
    flow_loads,
    quantiles,
    worked,
)
from PIL import Image
from scipy.optimize import brentq

from incipient.arrays import Floats
from incipient.files import csv_text
from incipient.flumes.thresholds import soulsby_whitehouse
from incipient.pictures import style
from incipient.setup.base_flow import MeanProfile
from incipient.survey.beds import Spheres
from incipient.survey.thresholds import FOLDS
from incipient.thresholds.laws import Gaussian
from incipient.thresholds.mean_flow import near_wall

ROOT = Path(__file__).resolve().parents[1]
BEADS, FLUMES, ZANKE = (
    ROOT / "docs/validation/beads.csv",
    ROOT / "benchmarks" / "reference" / "shields_flume.csv",
    ROOT / "incipient/flumes/zanke_2003.csv",
)
NUMBERS, PICTURE = (
    ROOT / "docs/validation/shields.csv",
    ROOT / "docs/figures/shields.webp",
)
OF_BED = ROOT / "incipient/flumes/natural_bed.csv"
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
VISCOSITY, GRAVITY = 1e-6, 9.81  # of water at 20 degrees, of the flumes [m^2/s, m/s^2]
SAMPLES, SEED = 20_000, 1
# Mean flows of the natural bed, u* d/nu, and of the fraction of its grains whose gusts exceed the computed flows.
PLACES, BEYOND = (0.0, 0.3, 1.0, 3.0, 10.0, 15.0, 30.0, 100.0, 300.0, 1000.0), 0.1
SHOWN, LEFT = 0.01, 0.1  # probability of the figure; where creeping flow is drawn
DRAWS = 6  # of what emulators cannot tell
OTHER_FRICTION, ROUNDS = 0.5, 20
QUANTILES = tuple(f"q{100 * share:g}" for share in SHARES)
OF_ERRORS = ("flow", "emulator", "beds", "law", "friction")
COLUMNS_OF_BED = ("shear_reynolds", "probability", *QUANTILES, *OF_ERRORS)
COLUMNS = ("arrangement", "spacing", "shear_reynolds", "probability", "shields", "flow", "law")


@dataclass(frozen=True)
class Bead:
    """A bead as large as the spheres of its bed, and the steady flow that moves it.

    shear_reynolds: u* d/nu of that flow; shields, error: its Shields number
    top: height of its top above the crests, in diameters
    """

    arrangement: str
    spacing: float
    shear_reynolds: float
    shields: float
    error: float
    top: float

    def mean(
        self, probability: float, share: float = 1.0, lognormal: bool = True
    ) -> tuple[float, float]:
        """Shields number and u* d/nu of the mean flow in which the bead is moved at an instant with a probability.

        share: multiplies the critical Shields number
        """

        def excess(logarithm: float) -> float:
            strength = math.exp(logarithm)
            at = self.shear_reynolds * math.sqrt(strength)
            return strength * Gaussian(self.intensity(at), lognormal).level(probability) - share

        strength = math.exp(brentq(excess, math.log(1e-3), math.log(1e2)))
        return strength * self.shields, self.shear_reynolds * math.sqrt(strength)

    def intensity(self, shear_reynolds: float) -> float:
        """u'/u at the bead's top, which is in the viscous layer: u = u* k+ h/d."""
        return (
            near_wall(shear_reynolds) / (shear_reynolds * self.top)
            if shear_reynolds
            else 0.49 / self.top
        )


def beads() -> list[Bead]:
    """All beads of docs/validation/beads.csv that are as large as the spheres of their bed."""
    result = []
    for row in csv.DictReader(BEADS.open()):
        spacing = float(row["spacing"])
        if float(row["size"]) != 1.0:
            continue
        side = spacing / math.sqrt(2.0 if row["arrangement"] == "square" else 3.0)
        # On a wide square substrate the bead leans on two spheres, at the height of their centres' plane.
        rise = math.sqrt(max(1.0 - side**2, 0.25))
        shear = math.sqrt(float(row["reynolds"]))
        result.append(
            Bead(
                row["arrangement"], spacing, shear, float(row["shields"]), float(row["error"]), rise
            )
        )
    return result


def computed() -> list[dict[str, object]]:
    """Mean flows of all beads and probabilities, with the errors of the flow and the spread of the law."""
    rows = []
    for bead in beads():
        for probability in PROBABILITIES:
            shields, shear = bead.mean(probability)
            ends = [
                bead.mean(probability, 1.0 + sign * bead.error / bead.shields)[0]
                for sign in (-1.0, 1.0)
            ]
            other, _ = bead.mean(probability, lognormal=False)
            of_flow = max(abs(one - shields) for one in ends)
            values = (
                bead.arrangement,
                bead.spacing,
                shear,
                probability,
                shields,
                of_flow,
                abs(other - shields),
            )
            rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows


# -- the natural bed ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Pooled:
    """The grains of several draws of a natural bed, all counting alike."""

    draws: list[NaturalBed]

    def shields(self, at: tuple[float, float], lognormal: bool = True) -> tuple[Floats, float]:
        """Shields numbers (draws, n) in a flow of a u* d/nu at a probability, and the share of gusts not computed."""
        result = [one.shields(*at, lognormal) for one in self.draws]
        return np.array([one for one, _ in result]), max(beyond for _, beyond in result)

    def median(self, at: tuple[float, float], lognormal: bool = True) -> float:
        """Of the Shields numbers."""
        return float(quantiles_of(self.shields(at, lognormal)[0], (0.5,))[0])


def quantiles_of(values: Floats, shares: Sequence[float] = SHARES) -> Floats:
    """Quantiles of values of any shape, all counting alike."""
    return quantiles(values.ravel(), np.full(values.size, 1.0 / values.size), shares)


def natural(sample: Sample) -> list[dict[str, float]]:
    """Quantiles over the grains of the natural bed of the mean flow's Shields number, and errors of their median.

    flow: of the runs; emulator: standard error by leaving out a fifth of the runs at a time; beds: standard error by
    the beds' own medians; law: with the other law of fluctuations; friction: with another coefficient, no error but
    what the assumption does
    """
    share = flow_error()
    bed = Pooled([sample.drawn(seed) for seed in range(DRAWS)])
    slippery = Pooled([sample.drawn(seed, OTHER_FRICTION) for seed in range(DRAWS)])
    fewer = [
        Pooled([part.drawn(seed) for seed in range(DRAWS)])
        for part in (sample.without(fold) for fold in range(FOLDS))
    ]
    rows = []
    for at in product(PLACES, PROBABILITIES):
        shields, beyond = bed.shields(at)
        if beyond > BEYOND:
            continue
        own = bed.median(at)
        each = [
            float(quantiles_of(shields[:, sample.beds == one], (0.5,))[0])
            for one in set(sample.beds)
        ]
        parts = np.array([one.median(at) for one in fewer])
        errors = (
            share * own,
            math.sqrt((FOLDS - 1) / FOLDS * ((parts - parts.mean()) ** 2).sum()),
            float(np.std(each, ddof=1) / math.sqrt(len(each))),
            abs(bed.median(at, False) - own),
            slippery.median(at) - own,
        )
        values = (*at, *quantiles_of(shields).tolist(), *errors)
        rows.append(dict(zip(COLUMNS_OF_BED, values, strict=True)))
    return rows


def assumptions(loads: list[FlowLoads]) -> str:
    """What other frictions and other beds do to the median, as a table: one bed, in flows of four directions."""
    first, spheres_of_tries = natural_bed.first_bed()[0], natural_bed.spheres_of_tries
    made: list[tuple[str, Spheres, float]] = [
        ("as above, one bed", first, natural_bed.FRICTION),
        (f"friction {OTHER_FRICTION:g}", first, OTHER_FRICTION),
        ("looser: each sphere dropped at one place", spheres_of_tries(1), natural_bed.FRICTION),
        ("more level: into the lowest of 40", spheres_of_tries(40), natural_bed.FRICTION),
        (
            f"the tenth that goes first moved, {ROUNDS} times",
            worked(first, loads[0], ROUNDS),
            natural_bed.FRICTION,
        ),
    ]
    lines = [
        "| bed | protrusion | pivot angle | creeping, 1% | 10, 1% | 10, 50% | held at 10 |",
        "|" + " --- |" * 7,
    ]
    for name, spheres, friction in made:
        grains = [
            one
            for azimuth in natural_bed.AZIMUTHS
            for one in natural_bed.free_grains(spheres, azimuth)
        ]
        sample = Sample(grains, np.zeros(len(grains), dtype=np.int64), loads)
        bed = Pooled([sample.drawn(seed, friction) for seed in range(DRAWS)])
        pivot = np.median([one.pivot for one in grains])
        shields = [bed.median(at) for at in ((0.0, 0.01), (10.0, 0.01), (10.0, 0.5))]
        held = float(np.isinf(bed.shields((10.0, 0.01))[0]).mean())
        words = f"{np.median(sample.heights):.2f} | {pivot:.0f}° | {' | '.join(map(_short, shields))} | {held:.0%}"
        lines.append(f"| {name} | {words} |")
    return "\n".join(lines)


def _short(value: float) -> str:
    """A Shields number in three digits, or that no flow moves these grains."""
    return f"{value:.3g}" if math.isfinite(value) else "held"


# -- others ---------------------------------------------------------------------------------------------------


def flumes() -> tuple[np.ndarray, np.ndarray]:
    """u* d/nu and critical Shields numbers that were observed, in water at 20 degrees."""
    lines = [line for line in FLUMES.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    shields, size, density = (
        np.array([float(row[name]) for row in rows]) for name in ("shields", "d50", "density")
    )
    shear_velocity = np.sqrt(shields * (density / 1000.0 - 1.0) * GRAVITY * size)
    return shear_velocity * size / VISCOSITY, shields


def balanced(shear_reynolds: float) -> np.ndarray:
    """Critical Shields numbers (3,), quartiles and median, by a balance of forces (Wiberg & Smith 1987).

    Drag coefficient 0.76 +- 0.29 (0.1 to 3), lift 0.85 of it, protrusion 0.7 +- 0.4 (0.1 to 1), friction coefficient
    lognormal 2.75 +- 0.27, truncated normals, as Feehan et al. (2023) assume; the velocity is the mean of the smooth to
    rough profile over the height that protrudes.
    """
    random = np.random.default_rng(SEED)
    drag, protrusion = (
        truncated(random, *numbers) for numbers in ((0.76, 0.29, 0.1, 3.0), (0.7, 0.4, 0.1, 1.0))
    )
    spread = math.sqrt(math.log1p((0.27 / 2.75) ** 2))
    friction = random.lognormal(math.log(2.75) - 0.5 * spread**2, spread, SAMPLES)
    # Area of the part of a disc of diameter one that is above a chord, and of the whole.
    angle = np.arccos(1.0 - 2.0 * protrusion)
    exposed, whole = 0.25 * (angle - np.sin(angle) * np.cos(angle)), 0.25 * math.pi
    # v^2/((s - 1) g d) = 2 (pi/6) mu/(C_D A_e + mu C_L A), on a level bed.
    speed = np.sqrt(math.pi / 3.0 * friction / (drag * exposed + friction * 0.85 * drag * whole))
    heights = np.linspace(0.0, 1.0, 401)[1:]
    profile = MeanProfile(1.0, 1.0 / shear_reynolds, 1.0, 2.0).speed(heights)
    mean = np.interp(protrusion, heights, np.cumsum(profile) / np.arange(1, len(heights) + 1))
    return np.quantile((speed / mean) ** 2, (0.25, 0.5, 0.75))


def truncated(
    random: np.random.Generator, mean: float, deviation: float, low: float, high: float
) -> np.ndarray:
    """Samples of a normal distribution between bounds."""
    drawn = random.normal(mean, deviation, 10 * SAMPLES)
    return drawn[(drawn > low) & (drawn < high)][:SAMPLES]


def figure(of_bed: list[dict[str, float]]) -> Figure:
    """Observations, curves, and the natural bed's median and spread.

    Beads on regular substrates are left out: their datum is at the crests, that of the bed at its mean level.
    """
    drawn = Figure(figsize=(7.2, 6.0), layout="constrained")
    axes = drawn.add_subplot()
    axes.plot(*flumes(), ".", color="#b5b5b5", markersize=3, label="flumes, 511 observations")
    places = np.geomspace(0.1, 2000.0, 40)
    low, median, high = np.array([balanced(one) for one in places]).T
    axes.fill_between(places, low, high, color=style.WEIGHT, alpha=0.15, linewidth=0.0)
    axes.plot(
        places,
        median,
        color=style.WEIGHT,
        lw=1.0,
        label="force balance, assumed drag and protrusion",
    )
    size = np.geomspace(0.5, 600.0, 80)
    curve = soulsby_whitehouse(size)
    axes.plot(
        np.sqrt(curve * size**3),
        curve,
        "--",
        color=style.INK,
        lw=0.9,
        label="Soulsby & Whitehouse (1997)",
    )
    lines = [line for line in ZANKE.read_text().splitlines() if not line.startswith("#")]
    zanke = np.array(
        [[float(row["Re_star"]), float(row["theta_c"])] for row in csv.DictReader(lines)]
    )
    axes.plot(*zanke.T, ":", color=style.INK, lw=1.1, label="Zanke (2003)")
    draw_bed(axes, of_bed)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="u* d/ν [-]",
        ylabel="Shields number [-]",
        xlim=(0.08, 2000.0),
    )
    axes.set_ylim(0.002, 2.0)
    drawn.legend(fontsize="small", loc="outside lower center", ncols=2)
    return drawn


def draw_bed(axes: Axes, of_bed: list[dict[str, float]]) -> None:
    """The natural bed: bands of quartiles and outer tenths at a probability, and medians at two."""
    for probability, line in ((SHOWN, "-"), (PROBABILITIES[-1], "-.")):
        own = [one for one in of_bed if one["probability"] == probability]
        across = [max(one["shear_reynolds"], LEFT) for one in own]
        label = f"natural bed, {100 * probability:g}% of the time: median"
        if probability == SHOWN:
            for ends, alpha in (((0, -1), 0.15), ((1, -2), 0.25)):
                low, high = ([min(one[QUANTILES[end]], 10.0) for one in own] for end in ends)
                axes.fill_between(across, low, high, color=style.FLOW, alpha=alpha, linewidth=0.0)
            label += ", quartiles, 10 to 90%"
        axes.plot(across, [one["q50"] for one in own], line, color=style.FLOW, lw=1.8, label=label)


def main() -> None:
    """Write numbers and picture; print what other assumptions give."""
    loads = flow_loads()
    rows, sample = computed(), Sample(*natural_bed.sample(), loads)
    of_bed = natural(sample)
    NUMBERS.write_text(csv_text(COLUMNS, rows))
    OF_BED.write_text(
        csv_text(COLUMNS_OF_BED, [{k: f"{v:.4g}" for k, v in row.items()} for row in of_bed])
    )
    with style.applied():
        drawn = figure(of_bed)
        with BytesIO() as held:
            drawn.savefig(held, dpi=style.DOTS_PER_INCH, format="png")
            Image.open(held).convert("RGB").save(PICTURE, "WEBP", quality=85)
    print(assumptions(loads))


if __name__ == "__main__":
    main()
