"""What a survey has found, as data: the grains, their thresholds, and the bed as a whole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, known_percentiles, percentile
from .deposition import Spheres
from .emulator import FOR_LEVEL, LEVEL
from .laws import kirchner, with_constant_drag
from .pockets import Pocket, Surface
from .request import SurveyRequest
from .thresholds import PERCENTILES, Threshold

SHARES = (5, 16, 50, 84, 95)  # percentiles of distributions
TOO_FEW = 2  # values, of which not even a median is told
CURVE = 60  # Shields numbers of the curve of mobile grains
FIRST = 10  # grains named in the text
COLUMNS = (
    *(
        "number",
        "x",
        "y",
        "z",
        "diameter",
        "visible",
        "carries",
        "contacts",
        "protrusion",
        "exposure",
        "sheltered",
    ),
    *(
        "backed",
        "skew",
        "shifted",
        "pivot",
        "critical_force",
        "shields_constant_drag",
        "loads",
        "mode",
        "shields",
    ),
    *("shields_low", "shields_high", "stress", "stress_low", "stress_high", "rank"),
)


@dataclass(frozen=True, eq=False)
class EmulatorRecord:
    """How good the emulator is.

    error, bar: root mean square over runs of the drag's error, each foretold without the fifth of them that it is in,
        over the mean drag; and of the bars of one standard deviation
    within: share of the six coefficients of these that were within 1.96 bars; mean_bar: of the critical Shields number
        over grains without a run, as a share of it
    to_halve: runs that would halve the mean bar of the drag; flow: error of the runs' drag, None where none has it
    level: probability with which bars hold
    """

    runs: int
    failed: int
    error: float
    bar: float
    within: float
    mean_bar: float
    to_halve: int
    flow: float | None
    level: float


@dataclass(frozen=True, eq=False)
class SurveyOutcome:
    """A survey: its bed and surface, its exposed grains, thresholds of those that carry no other, and the emulator.

    runs: grains with a full run, in their order; mark: of the bed and the flow that these belong to
    """

    asked: SurveyRequest
    spheres: Spheres
    surface: Surface
    exposed: int
    pockets: Sequence[Pocket]
    thresholds: Sequence[Threshold] = ()
    emulator: EmulatorRecord | None = None
    runs: tuple[int, ...] = ()
    mark: str = ""

    @property
    def free(self) -> list[Pocket]:
        """Exposed grains that carry no other one."""
        return [one for one in self.pockets if not one.carries]

    @property
    def _stress(self) -> tuple[Floats, Floats]:
        """Critical stresses (n,) and draws of them (n, k), over the submerged specific weight of the median grain."""
        sizes = np.array([one.pocket.diameter for one in self.thresholds]) / self.surface.median
        own = np.array([one.shields for one in self.thresholds])
        return own * sizes, np.array([one.draws for one in self.thresholds]) * sizes[:, None]

    def distribution(self) -> list[dict[str, float]]:
        """Percentiles of the critical Shields number by the median grain, with bars of each."""
        own, draws = self._stress
        rows = []
        for share in known_percentiles(SHARES, len(own)):
            rows.append({"percentile": share, "shields": float(percentile(own, share))})
            rows[-1] |= _range_of(percentile(draws, share))
        return rows

    def curve(self) -> list[dict[str, float]]:
        """Share of the free grains that is mobile, against the Shields number, with bars."""
        own, draws = self._stress
        finite = own[np.isfinite(own) & (own > 0.0)]
        if not len(finite):
            return []
        rows = []
        for shields in np.geomspace(0.7 * finite.min(), 1.4 * finite.max(), CURVE).tolist():
            shares = (draws <= shields).mean(axis=0)
            rows.append({"shields": shields, "mobile": float((own <= shields).mean())})
            rows[-1] |= _range_of(shares)
        return rows

    def pivots(self) -> list[dict[str, float]]:
        """Percentiles of the pivot angle, reduced to grains of the median size, beside Kirchner's law."""
        # The law's own power of the size: (D/K50)^-0.3.
        reduced = [one.pivot * (one.diameter / self.surface.median) ** 0.3 for one in self.free]
        known = np.array([one for one in reduced if math.isfinite(one)])
        return [
            {
                "percentile": share,
                "pivot": float(percentile(known, share)),
                "kirchner": float(kirchner(share)),
            }
            for share in known_percentiles(SHARES, len(known))
        ]

    def rows(self) -> list[dict[str, Any]]:
        """A row for each surveyed grain, those that go first at the front."""
        known = {one.pocket.number: one for one in self.thresholds}
        rows = [self._row(one, known.get(one.number)) for one in self.pockets]
        rows.sort(key=lambda row: (row.get("stress", math.inf), row["number"]))
        for rank, row in enumerate(rows, 1):
            if math.isfinite(row.get("stress", math.inf)):
                row["rank"] = rank
        return rows

    def _row(self, grain: Pocket, threshold: Threshold | None) -> dict[str, Any]:
        ratio = grain.diameter / self.surface.median
        names = (
            "number",
            "diameter",
            "visible",
            "carries",
            "protrusion",
            "exposure",
            "sheltered",
            "backed",
            "skew",
        )
        row: dict[str, Any] = {
            name: getattr(grain, name) for name in (*names, "shifted", "pivot", "critical_force")
        }
        row |= dict(zip("xyz", grain.centre.tolist(), strict=True))
        row["contacts"] = len(grain.contacts)
        row["shields_constant_drag"] = with_constant_drag(grain.pivot, grain.protrusion, ratio)
        if threshold is None:
            return row
        low, high = threshold.bar
        row |= {"loads": "run" if threshold.is_computed else "emulator", "mode": threshold.mode}
        row |= {"shields": threshold.shields, "shields_low": low, "shields_high": high}
        return row | {
            "stress": ratio * threshold.shields,
            "stress_low": ratio * low,
            "stress_high": ratio * high,
        }

    def to_dict(self) -> dict[str, Any]:
        """All of it but the grains as plain data for survey.json."""
        return {
            "title": self.asked.title,
            "request": self.asked.model_dump(mode="json"),
            "bed": {
                "grains": len(self.spheres),
                "median_diameter": self.surface.median,
                "level": self.surface.level,
                "deviation": self.surface.deviation,
                "period": None if self.spheres.period is None else self.spheres.period.tolist(),
            },
            "exposed": self.exposed,
            "surveyed": len(self.pockets),
            "free": len(self.free),
            "pivots": self.pivots(),
            "constant_drag": self.constant_drag(),
            "distribution": self.distribution() if self.thresholds else [],
            "mobile": self.curve() if self.thresholds else [],
            "emulator": None if self.emulator is None else vars(self.emulator),
            "runs": {"of": self.mark, "grains": self.runs},
        }

    def constant_drag(self) -> list[dict[str, float]]:
        """Percentiles of the critical Shields number by one drag coefficient for all and a log law."""
        found = []
        for one in self.free:
            ratio = one.diameter / self.surface.median
            found.append(ratio * with_constant_drag(one.pivot, one.protrusion, ratio))
        return [
            {"percentile": share, "shields": float(percentile(found, share))}
            for share in known_percentiles(SHARES, len(found))
        ]

    def text(self) -> str:
        """The survey in a few lines."""
        median, bed = self.surface.median, self.surface
        lines = [
            f"bed                 {len(self.spheres)} grains, median diameter {median:.4g}; "
            f"surface at {bed.level:.4g}, standard deviation {bed.deviation / median:.2g} diameters",
            f"exposed             {self.exposed} grains; {len(self.pockets)} rest on their neighbours, "
            f"{len(self.free)} of these carry no other",
        ]
        for row in self.pivots():
            lines.append(
                _line(
                    "pivot angle",
                    row,
                    f"{row['pivot']:.1f} degrees; Kirchner et al. {row['kirchner']:.1f}",
                )
            )
        if not self.thresholds:
            return "\n".join(
                [*lines, "loads               none computed: give runs.number, or --runs N"]
            )
        others = {row["percentile"]: row["shields"] for row in self.constant_drag()}
        for row in self.distribution():
            said = f"{row['shields']:.4g} ({row['low']:.4g} to {row['high']:.4g}); one drag coefficient and a log law "
            lines.append(_line("Shields number", row, f"{said}{others[row['percentile']]:.3g}"))
        if len(self.thresholds) <= TOO_FEW:
            lines.append(few([one.shields for one in self.thresholds]))
        first = [str(row["number"]) for row in self.rows() if "rank" in row][:FIRST]
        lines.append(f"first to go         grains {', '.join(first)}")
        return "\n".join(lines + (self._emulator_lines() if self.emulator else []))

    def _emulator_lines(self) -> list[str]:
        record = self.emulator
        assert record is not None
        flow = "not estimated" if record.flow is None else f"{record.flow:.1%} of the drag"
        failed = f", {record.failed} failed" if record.failed else ""
        least = "" if record.level >= LEVEL else f": so few runs tell no more; {FOR_LEVEL} tell 95%"
        return [
            f"runs                {record.runs}{failed}; error of the flow {flow}",
            f"bars                hold with a probability of {record.level:.0%}{least}",
            f"emulator            drag of runs foretold without their fifth: error {record.error:.1%}, "
            f"bar {record.bar:.1%} (one standard deviation); {record.within:.0%} of all coefficients within 1.96 bars",
            f"                    {record.to_halve} more runs would halve the mean bar of the drag (--runs "
            f"{record.to_halve})",
        ]


def _range_of(drawn: Floats) -> dict[str, float]:
    low, high = (float(percentile(drawn, share)) for share in PERCENTILES)
    return {"low": low, "high": high}


def few(values: Sequence[float]) -> str:
    """The line on Shields numbers that are too few for percentiles."""
    told = ", ".join(f"{value:.4g}" for value in sorted(values))
    return f"Shields number      {told}: too few for percentiles"


def _line(name: str, row: dict[str, float], said: str) -> str:
    return f"{name:<19} {row['percentile']:>3g}% below {said}"
