"""Shields' curve below the log layer: beads in pockets, in a fluctuating stream, beside flumes and balances of forces.

Thresholds of the beads are those of docs/beads.csv, in the linear profile next to a bed; the fluctuation is lognormal,
of the intensity near walls of `incipient.entrainment`. Nothing is fitted. Beside them: 511 observations in flumes, a
balance of forces by Monte Carlo with assumed drag, lift and protrusion, Zanke's curve, Soulsby & Whitehouse's.

Cost:    seconds; the beads' flows an hour and a half (`python benchmarks/beads.py --study results`).
Run:     python benchmarks/shields.py
Results: docs/figures/shields.webp, docs/shields.csv and the table in docs/shields.md
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from scipy.optimize import brentq

from incipient.entrainment.laws import Gaussian
from incipient.entrainment.stream import near_wall
from incipient.files import csv_text
from incipient.pictures import style
from incipient.planning.mean_profile import MeanProfile

ROOT = Path(__file__).resolve().parents[1]
BEADS, FLUMES, ZANKE = (
    ROOT / "docs" / "beads.csv",
    ROOT / "benchmarks" / "reference" / "shields_flume.csv",
    ROOT / "benchmarks" / "reference" / "zanke_2003.csv",
)
PAGE, NUMBERS, PICTURE = (
    ROOT / "docs" / "shields.md",
    ROOT / "docs" / "shields.csv",
    ROOT / "docs/figures/shields.webp",
)
BEGIN, END = "<!-- shields: begin -->", "<!-- shields: end -->"
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)
VISCOSITY, GRAVITY = 1e-6, 9.81  # of water at 20 degrees, of the flumes [m^2/s, m/s^2]
SAMPLES, SEED = 20_000, 1
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

    def mean(self, probability: float, share: float = 1.0, lognormal: bool = True) -> tuple[float, float]:
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
        return near_wall(shear_reynolds) / (shear_reynolds * self.top) if shear_reynolds else 0.49 / self.top


def beads() -> list[Bead]:
    """All beads of docs/beads.csv that are as large as the spheres of their bed."""
    found = []
    for row in csv.DictReader(BEADS.open()):
        spacing = float(row["spacing"])
        if float(row["size"]) != 1.0:
            continue
        side = spacing / math.sqrt(2.0 if row["arrangement"] == "square" else 3.0)
        # On a wide square substrate the bead leans on two spheres, at the height of their centres' plane.
        rise = math.sqrt(max(1.0 - side**2, 0.25))
        shear = math.sqrt(float(row["reynolds"]))
        found.append(
            Bead(row["arrangement"], spacing, shear, float(row["shields"]), float(row["error"]), rise)
        )
    return found


def computed() -> list[dict[str, object]]:
    """Mean flows of all beads and probabilities, with the errors of the flow and the spread of the law."""
    rows = []
    for bead in beads():
        for probability in PROBABILITIES:
            shields, shear = bead.mean(probability)
            ends = [bead.mean(probability, 1.0 + sign * bead.error / bead.shields)[0] for sign in (-1.0, 1.0)]
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


def soulsby_whitehouse(size: np.ndarray) -> np.ndarray:
    """Critical Shields number of sand in water by the dimensionless size D* (Soulsby & Whitehouse 1997)."""
    return 0.30 / (1.0 + 1.2 * size) + 0.055 * (1.0 - np.exp(-0.020 * size))


def table(rows: list[dict[str, object]]) -> str:
    """Shields numbers of all beads by probability."""
    lines = ["| substrate | spacing | u* d/ν at 1% | 0.1% | 1% | 5% | 50% | steady |", "|" + " --- |" * 8]
    for bead in beads():
        name, spacing, steady = bead.arrangement, bead.spacing, bead.shields
        own = [bead.mean(one) for one in PROBABILITIES]
        errors = []
        for probability, (shields, _) in zip(PROBABILITIES, own, strict=True):
            row = next(
                one
                for one in rows
                if (one["arrangement"], one["spacing"], one["probability"], one["shields"])
                == (name, spacing, probability, shields)
            )
            errors.append(float(str(row["flow"])) + float(str(row["law"])))
        cells = [f"{shields:.4f} ± {error:.4f}" for (shields, _), error in zip(own, errors, strict=True)]
        lines.append(f"| {name} | {spacing:g} | {own[1][1]:.2g} | {' | '.join(cells)} | {steady:.4f} |")
    return "\n".join(lines)


def figure(rows: list[dict[str, object]]) -> Figure:
    """Observations, curves and beads."""
    drawn = Figure(figsize=(7.2, 5.8), layout="constrained")
    axes = drawn.add_subplot()
    axes.plot(*flumes(), ".", color="#b5b5b5", markersize=3, label="flumes, 511 observations")
    places = np.geomspace(0.1, 2000.0, 40)
    low, median, high = np.array([balanced(one) for one in places]).T
    axes.fill_between(places, low, high, color=style.WEIGHT, alpha=0.2, linewidth=0.0)
    axes.plot(
        places, median, color=style.WEIGHT, lw=1.0, label="balance of forces, assumed drag and protrusion"
    )
    size = np.geomspace(0.5, 600.0, 80)
    curve = soulsby_whitehouse(size)
    axes.plot(
        np.sqrt(curve * size**3), curve, "--", color=style.INK, lw=0.9, label="Soulsby & Whitehouse 1997"
    )
    lines = [line for line in ZANKE.read_text().splitlines() if not line.startswith("#")]
    zanke = np.array([[float(row["Re_star"]), float(row["theta_c"])] for row in csv.DictReader(lines)])
    axes.plot(*zanke.T, ":", color=style.INK, lw=1.1, label="Zanke 2003")
    looks = {"triangular": ("^", style.FLOW), "square": ("s", style.PUSH)}
    for name, (marker, colour) in looks.items():
        for probability, fill in ((PROBABILITIES[1], colour), (PROBABILITIES[3], "white")):
            chosen = [one for one in rows if one["arrangement"] == name and one["probability"] == probability]
            # Creeping flow has no Reynolds number: those beads are drawn at the left.
            across = [max(float(str(one["shear_reynolds"])), 0.1) for one in chosen]
            up = [float(str(one["shields"])) for one in chosen]
            label = f"bead, {name} substrate, {100 * probability:g}%"
            axes.plot(across, up, marker, color=colour, markerfacecolor=fill, markersize=5, label=label)
    axes.set(
        xscale="log", yscale="log", xlabel="u* d/ν [-]", ylabel="Shields number [-]", xlim=(0.08, 2000.0)
    )
    axes.set_ylim(0.002, 2.0)
    drawn.legend(fontsize="small", loc="outside lower center", ncols=2)
    return drawn


def main() -> None:
    """Write numbers, picture and table."""
    rows = computed()
    NUMBERS.write_text(csv_text(COLUMNS, rows))
    with style.applied():
        drawn = figure(rows)
        with BytesIO() as held:
            drawn.savefig(held, dpi=style.DOTS_PER_INCH, format="png")
            Image.open(held).convert("RGB").save(PICTURE, "WEBP", quality=85)
    text = PAGE.read_text()
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}\n\n{table(rows)}\n\n{END}{after}")
    print(table(rows))


if __name__ == "__main__":
    main()
