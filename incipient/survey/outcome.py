"""The results of a survey as data, with published laws for comparison.

Lengths of the laws are in diameters of the grain, angles in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, known_percentiles, percentile
from .beds import Spheres
from .full_runs import LoadCoefficients, relative_error
from .pockets import Pocket, Surface
from .request import Survey
from .thresholds import FOR_LEVEL, LEVEL, NINETY_FIVE, Emulator, Threshold, range_of

SHARES = (5, 16, 50, 84, 95)  # percentiles of distributions
TOO_FEW = 2  # values that have not even a median
COLUMNS = (
    *("number", "x", "y", "z", "diameter", "visible", "carries", "contacts", "protrusion"),
    *("exposure", "sheltered", "backed", "skew", "shifted", "pivot", "critical_force"),
    *("shields_constant_drag", "loads", "mode", "shields", "shields_low", "shields_high"),
    *("stress", "stress_low", "stress_high", "rank"),
)
HEIGHTS = 400  # of the quadrature


def with_constant_drag(pivot: float, protrusion: float, ratio: float) -> float:
    """Shields number at which a constant drag coefficient and a rough log law, without lift, move a grain.

    pivot: angle; protrusion: top above the bed's mean level, where the velocity is zero; ratio: diameter over the
    median. Infinite without protrusion, or if no force along the flow moves the grain.
    """
    if not (protrusion > 0.0 and pivot < 90.0):
        return math.inf
    heights = protrusion * (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    width = 2.0 * np.sqrt(np.maximum(0.25 - (heights - protrusion + 0.5) ** 2, 0.0))
    # Nikuradse's z0 of rough walls is the median diameter over 30.
    speed = np.log(np.maximum(30.0 * ratio * heights, 1.0)) / 0.41
    squared = float((speed**2 * width).sum()) * protrusion / HEIGHTS
    force = math.pi / 6.0 * math.tan(math.radians(pivot))
    # The drag coefficient is as Feehan et al. (2023) assume after Schmeeckle et al. (2007).
    return force / (0.5 * 0.76 * squared) if squared > 0.0 else math.inf


def quality(emulator: Emulator, runs: Sequence[LoadCoefficients], failed: int) -> dict[str, Any]:
    """The quality of the emulator.

    error, bar: root mean square of the cross-validated errors of the drag, over the mean drag; and of the bars of one
        standard deviation
    within: fraction of the six coefficients within 1.96 bars
    flow: error of the runs' drag, None: not known
    level: probability with which bars hold
    """
    wrong, bars, of_flow = emulator.errors, emulator.bars, relative_error(runs)
    drag = float(np.mean([abs(run.values[0]) for run in runs]))
    return {
        "runs": len(runs),
        "failed": failed,
        "error": float(np.sqrt((wrong[:, 0] ** 2).mean())) / drag,
        "bar": float(np.sqrt((bars[:, 0] ** 2).mean())) / drag,
        "within": float((np.abs(wrong) <= NINETY_FIVE * bars).mean()),
        "flow": float(of_flow[0]) if of_flow.any() else None,
        "level": emulator.level,
    }


@dataclass(frozen=True, eq=False)
class SurveyOutcome:
    """A survey: its bed and surface, its exposed grains, thresholds of those that carry no other, and the emulator."""

    request: Survey
    spheres: Spheres
    surface: Surface
    exposed: int
    pockets: Sequence[Pocket]
    thresholds: Sequence[Threshold] = ()
    emulator: dict[str, Any] | None = None

    @property
    def free(self) -> list[Pocket]:
        return [grain for grain in self.pockets if not grain.carries]

    @property
    def _stress(self) -> tuple[Floats, Floats]:
        ratios = np.array([self._ratio(threshold.pocket) for threshold in self.thresholds])
        own = np.array([threshold.shields for threshold in self.thresholds])
        draws = np.array([threshold.draws for threshold in self.thresholds])
        return own * ratios, draws * ratios[:, None]

    def _ratio(self, grain: Pocket) -> float:
        return grain.diameter / self.surface.median

    def distribution(self) -> list[dict[str, float]]:
        own, draws = self._stress
        return [
            row | range_of(percentile(draws, row["percentile"]), row["shields"])
            for row in percentiles("shields", own)
        ]

    def curve(self) -> list[dict[str, float]]:
        """Mobile fraction of the free grains, with bars, against the Shields number."""
        own, draws = self._stress
        finite = own[np.isfinite(own) & (own > 0.0)]
        if not len(finite):
            return []
        strengths = np.geomspace(0.7 * finite.min(), 1.4 * finite.max(), 60).tolist()
        mobile = [float((own <= shields).mean()) for shields in strengths]
        return [
            {"shields": shields, "mobile": value} | range_of((draws <= shields).mean(axis=0), value)
            for shields, value in zip(strengths, mobile, strict=True)
        ]

    def pivots(self) -> list[dict[str, float]]:
        """Percentiles of the pivot angle, reduced to the median size by Kirchner's power, and his law.

        The nth percentile is (30 + 0.5 n)(D/K50)^-0.3 degrees for water-worked mixtures of sand and gravel (Kirchner,
        Dietrich, Iseya & Ikeda 1990, Sedimentology 37, 647).
        """
        reduced = np.array([grain.pivot * self._ratio(grain) ** 0.3 for grain in self.free])
        rows = percentiles("pivot", reduced[np.isfinite(reduced)])
        return [row | {"kirchner": 30.0 + 0.5 * row["percentile"]} for row in rows]

    def constant_drag(self) -> list[dict[str, float]]:
        shields = [self._ratio(grain) * self._by_constant_drag(grain) for grain in self.free]
        return percentiles("shields", np.array(shields))

    def _by_constant_drag(self, grain: Pocket) -> float:
        return with_constant_drag(grain.pivot, grain.protrusion, self._ratio(grain))

    def rows(self) -> list[dict[str, Any]]:
        known = {threshold.pocket.number: threshold for threshold in self.thresholds}
        rows = [self._row(grain, known.get(grain.number)) for grain in self.pockets]
        rows.sort(key=lambda row: (row.get("stress", math.inf), row["number"]))
        for rank, row in enumerate(rows, 1):
            if math.isfinite(row.get("stress", math.inf)):
                row["rank"] = rank
        return rows

    def _row(self, grain: Pocket, threshold: Threshold | None) -> dict[str, Any]:
        row = vars(grain) | {
            **dict(zip("xyz", grain.centre.tolist(), strict=True)),
            "contacts": len(grain.contacts),
            "shields_constant_drag": self._by_constant_drag(grain),
        }
        if threshold is None:
            return row
        bar = range_of(threshold.draws, threshold.shields)
        for end, value in {"": threshold.shields, "_low": bar["low"], "_high": bar["high"]}.items():
            row[f"shields{end}"] = value
            row[f"stress{end}"] = self._ratio(grain) * value
        loads = "run" if threshold.is_computed else "emulator"
        return row | {"loads": loads, "mode": threshold.mode}

    def to_dict(self) -> dict[str, Any]:
        return {
            "title": self.request.title,
            "request": self.request.model_dump(mode="json"),
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
            "emulator": self.emulator,
        }

    def text(self) -> str:
        median, bed = self.surface.median, self.surface
        lines = [
            f"bed                 {len(self.spheres)} grains, median diameter {median:.4g}; "
            f"surface at {bed.level:.4g}, standard deviation {bed.deviation / median:.2g} diameters",
            f"exposed             {self.exposed} grains; {len(self.pockets)} rest on their neighbours, "
            f"{len(self.free)} of these carry no other",
        ]
        left = self.exposed - len(self.pockets)
        if left:
            why = (
                "rest farther than a quarter of a diameter from their measured position"
                if self.spheres.period is None
                else "lie on the floor of the box: give more grains"
            )
            lines.append(f"left out            {left} grains, which {why}")
        lines += [
            f"pivot angle         {row['percentile']:>3g}% below {row['pivot']:.1f} degrees; "
            f"Kirchner et al. {row['kirchner']:.1f}"
            for row in self.pivots()
        ]
        if not self.thresholds:
            lines.append("loads               none computed: give runs.number, or --runs N")
        lines += self._threshold_lines(self.emulator) if self.emulator else []
        return "\n".join(lines)

    def _threshold_lines(self, emulator: dict[str, Any]) -> list[str]:
        others = {row["percentile"]: row["shields"] for row in self.constant_drag()}
        lines = [
            f"Shields number      {row['percentile']:>3g}% below {row['shields']:.4g} "
            f"({row['low']:.4g} to {row['high']:.4g}); one drag coefficient and a log law "
            f"{others[row['percentile']]:.3g}"
            for row in self.distribution()
        ]
        if len(self.thresholds) <= TOO_FEW:
            lines.append(few([threshold.shields for threshold in self.thresholds]))
        first = [str(row["number"]) for row in self.rows() if "rank" in row][:10]
        lines += [f"first to move       grains {', '.join(first)}"]
        failed = f", {emulator['failed']} failed" if emulator["failed"] else ""
        flow = (
            "not estimated" if emulator["flow"] is None else f"{emulator['flow']:.1%} of the drag"
        )
        few_runs = f": so few runs show no more; 95% takes {FOR_LEVEL}"
        return [
            *lines,
            f"runs                {emulator['runs']}{failed}; error of the flow {flow}",
            f"bars                hold with a probability of {emulator['level']:.0%}"
            + (few_runs if emulator["level"] < LEVEL else ""),
            f"emulator            drag, 5-fold cross-validation: error {emulator['error']:.1%}, "
            f"bar {emulator['bar']:.1%} (one standard deviation); "
            f"{emulator['within']:.0%} of all coefficients within 1.96 bars",
        ]


def percentiles(name: str, values: Floats) -> list[dict[str, float]]:
    """Percentiles of a distribution, those that its number of values has, as rows."""
    return [
        {"percentile": share, name: float(percentile(values, share))}
        for share in known_percentiles(SHARES, len(values))
    ]


def few(values: Sequence[float]) -> str:
    """A line on Shields numbers too few for percentiles."""
    shown = ", ".join(f"{value:.4g}" for value in sorted(values))
    return f"Shields number      {shown}: too few for percentiles"
