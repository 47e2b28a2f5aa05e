"""Pictures of a sweep: a quantity against a parameter, maps over two; Shields' diagram, also of a flume."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ..errors import OutputError, SceneError
from ..files import require_ending
from ..flumes.answer import FlumeAnswer
from ..flumes.thresholds import OFTEN, SELDOM, natural_bed, soulsby_whitehouse, zanke
from ..results.quantity import HIGH, LOW
from ..scene.section import is_number
from ..sweep.store import Store
from ..sweep.table import columns, rows
from . import style

Rows = list[dict[str, Any]]

LARGEST_DIAMETER = "critical Shields number (largest diameter)"
# Dimensionless diameters D* of the curve and of Zanke's table, Reynolds numbers of natural beds.
_CURVE, _TABLE = np.geomspace(1.0, 400.0, 200), np.geomspace(1.2, 1150.0, 60)
_REYNOLDS = np.geomspace(0.1, 299.0, 60)

_ONE_GRAIN_AND_BEDS = (
    "Points: one grain in steady flow without gusts; incipient entrainment gives Shields numbers by probability. "
    "Dashed: a fit to observed beds of many grains in turbulent flow, without a stated probability."
)
_NAMES = {
    "shields": LARGEST_DIAMETER,
    "shields_nominal": "critical Shields number (nominal diameter)",
    "reynolds": "critical Reynolds number",
}


def draw(
    file: Path,
    announce: Callable[[Path], object] = lambda path: None,
    quantity: str | None = None,
    against: str | None = None,
    by: str | None = None,
) -> list[Path]:
    """Draw the pictures of a sweep next to its file, under its name.

    Args:
        quantity: column to draw; default: the critical Shields number, otherwise the safety factor.
        against, by: columns of the abscissa and of the curves; default: the first keys that the sweep varies.

    Raises:
        OutputError: without a computed case, or a picture cannot be written.
        SceneError: no such column.
    """
    with Store(file) as store:
        keys = store.keys()
    cases = [row for row in rows(file) if row["status"] == "done"]
    if not cases:
        raise OutputError(f"{file}: no case has been computed; continue with incipient sweep")
    figures: dict[str, Figure] = {}
    with style.applied():
        varied = [key for key in keys if len({str(row.get(key)) for row in cases}) > 1]
        against = against or next((key for key in varied if key != by), "source")
        by = by or next((key for key in varied if key != against), None)
        chosen = quantity or ("shields" if "shields" in cases[0] else "safety_factor")
        figures[chosen] = _curves(cases, chosen, against, by, file)
        if not quantity and any("shields" in row for row in cases):
            figures["threshold"] = _shields(cases, by, file)
        if by is not None and len(varied) > 1 and _numbers(cases, against) and _numbers(cases, by):
            figures["map"] = _map(cases, against, by, file)
        paths = [file.with_name(f"{file.stem}_{name}.png") for name in figures]
        for path, figure in zip(paths, figures.values(), strict=True):
            style.save(figure, path)
            announce(path)
    return paths


def _curves(cases: Rows, quantity: str, against: str, by: str | None, file: Path) -> Figure:
    for name in filter(None, (quantity, against, by)):
        if not any(name in row for row in cases):
            raise SceneError(f"{file}: has no column {name}; there are {', '.join(columns(cases))}")
    shown = [row for row in cases if quantity in row and against in row]
    if not _numbers(shown, quantity):
        raise SceneError(f"{file}: {quantity} is not a number in every case; draw another column")
    infinite = sum(math.isinf(row[quantity]) for row in shown)
    note = f"Infinite, so not drawn: {infinite} of {len(shown)} cases" if infinite else ""
    title = f"{_name_of(quantity)} against {_name_of(against)}"
    figure, axes = _figure_of(cases, title, note)
    _plot(axes, _families(shown, by), against, quantity)
    if _numbers(shown, against):
        _choose_scale(axes.set_xscale, [row[against] for row in shown])
    _choose_scale(axes.set_yscale, [row[quantity] for row in shown])
    if quantity == "safety_factor":
        axes.axhline(1.0, color=style.INK, lw=0.8, ls=":")
    axes.set(xlabel=_name_of(against), ylabel=_name_of(quantity))
    _legend(axes, by)
    return figure


def _plot(axes: Axes, families: dict[str, Rows], across: str, quantity: str) -> None:
    """Curves with error bars, broken at infinite values; words are categories of their axis, without lines."""
    looks = zip(families.items(), cycle(style.MARKERS), cycle(style.COLOURS), strict=False)
    for (label, cases), marker, colour in looks:
        worded = not _numbers(cases, across)
        ordered = cases if worded else sorted(cases, key=lambda row: row[across])
        y = np.array([float(row[quantity]) for row in ordered])
        y[np.isinf(y)] = np.nan
        ends = [[row.get(quantity + end, row[quantity]) for row in ordered] for end in (LOW, HIGH)]
        bars = np.nan_to_num(np.abs(np.array(ends, dtype=float) - y), posinf=0.0)
        axes.errorbar(
            [str(row[across]) if worded else float(row[across]) for row in ordered], y, yerr=bars,
            lw=0.0 if worded else 1.1, marker=marker, color=colour, label=label or None, ms=4.5,
            elinewidth=0.9, capsize=2.0,
        )  # fmt: skip


def _families(cases: Rows, by: str | None) -> dict[str, Rows]:
    """Cases by the value of a column; of many values, as of a refined sweep, the most frequent."""
    counted = Counter(row.get(by or "") for row in cases)
    values = list(counted)
    if len(values) > 20:  # as many as there are colours
        values = [value for value, _ in counted.most_common(len(style.COLOURS))]
    if by is not None and _numbers(cases, by):
        values = sorted(values, key=lambda value: float(value or 0.0))
    return {
        "" if by is None else f"{value:.4g}" if isinstance(value, float) else str(value): [
            row for row in cases if row.get(by or "") == value
        ]
        for value in values
    }


def _shields(cases: Rows, by: str | None, file: Path) -> Figure:
    critical = [row for row in cases if 0.0 < row.get("shields", 0.0) < math.inf]
    if not critical:
        raise OutputError(f"{file}: no case has a critical flow; see incipient table {file}")
    figure, axes = _figure_of(cases, "Critical Shields number", note=_ONE_GRAIN_AND_BEDS)
    families = _families(critical, None if by == "fluid.reynolds" else by)
    named = {label or "one grain, laminar flow": cases for label, cases in families.items()}
    _plot(axes, named, "shear_reynolds", "shields")
    beside_soulsby_whitehouse(axes)
    _legend(axes, by if len(families) > 1 else None)
    return figure


def _map(cases: Rows, across: str, up: str, file: Path) -> Figure:
    shown = [row for row in cases if across in row and up in row]
    value = "safety_factor" if any("safety_factor" in row for row in shown) else "shields"
    figure, axes = _figure_of(cases, f"Mode and {_name_of(value)}")
    safety = value == "safety_factor"
    known = [v for row in shown if 0.0 < (v := row.get(value, math.nan)) < math.inf] or [1.0]
    most = max(*known, 1.0 / min(known))  # of safety factors: white is the boundary of motion
    norm = LogNorm(1.0 / most, most) if safety else LogNorm(min(known), max(known))
    colours = ScalarMappable(norm, "RdBu" if safety else "viridis")
    families = _families(shown, "mode").items()
    for (mode, some), marker in zip(families, cycle(style.MARKERS), strict=False):
        x, y, values = ([float(row.get(n, math.nan)) for row in some] for n in (across, up, value))
        axes.scatter(
            x, y, 60, values, marker=marker, norm=norm, cmap=colours.cmap, plotnonfinite=True,
            edgecolor=style.INK, linewidth=0.5, clip_on=False,
            label="no verdict" if mode == "None" else mode,
        )  # fmt: skip
    figure.colorbar(colours, ax=axes, pad=0.02).set_label(_name_of(value))
    _choose_scale(axes.set_xscale, [row[across] for row in shown])
    _choose_scale(axes.set_yscale, [row[up] for row in shown])
    axes.set(xlabel=_name_of(across), ylabel=_name_of(up))
    _legend(axes, None)
    return figure


def _numbers(cases: Rows, name: str) -> bool:
    values = [row[name] for row in cases if name in row]
    return bool(values) and all(map(is_number, values))


def _figure_of(cases: Rows, title: str, note: str = "") -> tuple[Figure, Axes]:
    sources = ", ".join(dict.fromkeys(row["source"] for row in cases))
    figure, axes = style.chart(f"{title}  ({sources})", (7.2, 5.0))
    figure.supxlabel("\n".join(style.wrapped(note, 7.0, 8)), fontsize=8, x=0.02, ha="left")
    return figure, axes


def _legend(axes: Axes, by: str | None) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(title=by and _name_of(by), fontsize=8, title_fontsize=8)


def _choose_scale(set_scale: Callable[[str], object], values: Sequence[float]) -> None:
    known = [value for value in values if math.isfinite(value)]
    if known and min(known) > 0.0 and max(known) > 8.0 * min(known):  # about a decade
        set_scale("log")


def _name_of(column: str) -> str:
    return column if "." in column else _NAMES.get(column, column.replace("_", " "))


# -- Shields' diagram --------------------------------------------------------------------------------


def beside_soulsby_whitehouse(axes: Axes) -> None:
    """Draw their curve, and label the axes."""
    shields = soulsby_whitehouse(_CURVE)
    reynolds = np.sqrt(shields * _CURVE**3)
    axes.plot(
        reynolds, shields, "--", color="#858585", lw=1.2, zorder=1, label="Soulsby & Whitehouse (1997)"
    )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel="shear Reynolds number u* d/ν", ylabel=LARGEST_DIAMETER
    )


def draw_flume(answer: FlumeAnswer, path: Path) -> None:
    """Draw the flume's Shields number among critical ones to a PNG; raises OutputError."""
    require_ending(path, ".png")
    with style.applied():
        figure, axes = style.chart("Shields number of the flume")
        beside_soulsby_whitehouse(axes)
        shields = np.array([zanke(size) for size in _TABLE], dtype=float)
        reynolds = np.sqrt(shields * _TABLE**3)
        axes.plot(reynolds, shields, ":", color=style.WEIGHT, label="Zanke (2003)")
        beds = [natural_bed(float(at)) for at in _REYNOLDS]
        for probability, line in ((OFTEN, "-."), (SELDOM, "-")):
            medians = [bed.median(probability) for bed in beds if bed]
            axes.plot(
                _REYNOLDS, medians, line, color=style.FLOW,
                label=f"natural bed, motion for {100 * probability:g}% of the time",
            )  # fmt: skip
        errors = 1.0 + np.array([bed.error(SELDOM) for bed in beds if bed])
        band = (medians / errors, medians * errors)
        axes.fill_between(
            _REYNOLDS, *band, color=style.FLOW, alpha=0.15, lw=0, label="its standard error"
        )
        left = answer.slope_factor
        level = f", divided by {left:.2g} for its slope" if left < 1.0 else ""
        axes.plot(
            answer.shear_reynolds, answer.level_shields, "o", color=style.PUSH, ms=8,
            label=f"this flume{level}",
        )  # fmt: skip
        axes.set_ylabel("Shields number, level bed")
        axes.legend()
        style.save(figure, path)
