"""Critical Shields numbers of beds: published curves, observed beds, and the computed natural bed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from ..arrays import Floats

GRAINS = (10, 25, 50, 75, 90)  # percentiles of grains in the table of the natural bed
ERRORS = ("flow", "emulator", "beds", "law", "friction")  # standard errors there
OFTEN, SELDOM = 0.5, 0.01  # fractions of time


def soulsby_whitehouse(diameters: Floats | float) -> Any:
    """Critical Shields numbers by dimensionless diameter D* = d (g (s - 1)/nu^2)^(1/3).

    Soulsby & Whitehouse (1997, Proc. Pacific Coasts and Ports, 149).
    """
    return 0.30 / (1.0 + 1.2 * diameters) + 0.055 * (1.0 - np.exp(-0.020 * diameters))


def zanke(diameter: float) -> float | None:
    """Zanke's (2003) critical Shields number at a dimensionless diameter D*; None outside his table's 1.2 to 1157."""
    sizes, shields = (stored("zanke_2003.csv")[name] for name in ("D_star", "theta_c"))
    if not sizes[0] <= diameter <= sizes[-1]:
        return None
    return float(np.exp(np.interp(math.log(diameter), np.log(sizes), np.log(shields))))


def observed_fraction(ratio: float) -> float:
    """Fraction of observed beds that move at this multiple of the Shields number of Soulsby and Whitehouse.

    0.01 to 0.99: beyond that the observations are too few.
    """
    observed = stored("observed_beds.csv")
    fractions = ndtri(observed["percentile"] / 100.0)
    return float(ndtr(np.interp(math.log(ratio), np.log(observed["ratio"]), fractions)))


@dataclass(frozen=True, eq=False)
class NaturalBed:
    """Critical Shields numbers of the grains of random beds of equal spheres in flows of one u* d/nu.

    The velocity at each grain is lognormal, of Zanke's near-wall intensity (docs/validation/shields.md).

    probabilities: (n,) fractions of time in which a grain's threshold is exceeded
    shields:       (n, 5) critical Shields numbers of the grains of the percentiles `GRAINS`
    errors:        (n,) relative standard errors of the medians
    """

    probabilities: Floats
    shields: Floats
    errors: Floats

    @cached_property
    def medians(self) -> Floats:
        return self.shields[:, GRAINS.index(50)]

    def median(self, probability: float) -> float:
        return float(self.medians[self._row(probability)])

    def error(self, probability: float) -> float:
        return float(self.errors[self._row(probability)])

    def fraction_of_time(self, shields: float) -> float:
        """Fraction of time in which the median grain's threshold is exceeded at a Shields number.

        The logarithm is interpolated over the normal quantile, exact for a lognormal velocity of one intensity.
        """
        order = np.argsort(self.medians)
        levels = np.log(self.medians[order]), ndtri(self.probabilities[order])
        return float(ndtr(np.interp(math.log(shields), *levels)))

    def fraction_of_grains(self, shields: float, probability: float) -> float:
        """Fraction of grains, from 0.1 to 0.9, whose threshold is exceeded at least that fraction of the time."""
        levels = np.log(self.shields[self._row(probability)])
        return float(ndtr(np.interp(math.log(shields), levels, ndtri(np.array(GRAINS) / 100.0))))

    def _row(self, probability: float) -> int:
        return int(np.argmin(np.abs(self.probabilities - probability)))


def natural_bed(shear_reynolds: float) -> NaturalBed | None:
    """The natural bed at a u* d/nu, interpolated linearly in logarithms; None beyond the computed range, 300."""
    table = stored("natural_bed.csv")
    places, counts = np.unique(table["shear_reynolds"], return_counts=True)
    if not 0.0 <= shear_reynolds <= (levels := places[counts > 1])[-1]:
        return None
    rows = [table["shear_reynolds"] == level for level in levels]
    # Below the lowest number that is not zero, as in creeping flow, numbers hardly change.
    nodes = np.log([0.1 * levels[1], *levels[1:]])
    at = math.log(max(shear_reynolds, 0.1 * levels[1]))

    def interpolated(name: str) -> Floats:
        values = np.log([table[name][row] for row in rows])
        return np.exp([np.interp(at, nodes, column) for column in values.T])

    shields = np.column_stack([interpolated(f"q{percentile}") for percentile in GRAINS])
    squares = sum(interpolated(name) ** 2 for name in ERRORS)
    return NaturalBed(table["probability"][rows[0]], shields, np.sqrt(squares) / shields[:, 2])


@lru_cache
def stored(name: str) -> Mapping[str, Floats]:
    """Columns (n,) of a table beside this module."""
    lines = files(__package__).joinpath(name).read_text(encoding="utf-8").splitlines()
    names, *rows = (line for line in lines if not line.startswith("#"))
    return dict(zip(names.split(","), np.loadtxt(rows, delimiter=",").T, strict=True))
