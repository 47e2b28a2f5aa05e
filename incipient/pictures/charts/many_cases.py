"""Pictures of a sweep with very many cases: medians and the middle nine tenths in bins, in place of marks.

Numbers are read from the file's table of columns, not from each result.
"""

from __future__ import annotations

from collections import Counter
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...arrays import Floats
from ...errors import OutputError, SceneError
from ...sweep.store import Store
from .. import style
from .sweep_axes import (
    COLOURS,
    ONE_GRAIN_AND_BEDS,
    beside_soulsby_whitehouse,
    choose_scale,
    figure_of,
    legend,
    name_of,
)

BINS = 120  # along a curve
CELLS = 60  # along each side of a map
FEW = 20  # values that are drawn as they are, above which they are put in bins
FAMILIES = 6  # curves at most
LEAST = 3  # cases of a bin that is drawn
AT = "upper left"  # to look for a better place takes a second
BAND = (0.05, 0.95)  # shares of the cases of a bin below and above which they are left out

Columns = dict[str, Floats]


def figures(
    store: Store, quantity: str | None, against: str | None, by: str | None
) -> dict[str, Figure]:
    """The pictures of `sweep.draw` by name. Not collective.

    Raises:
        OutputError: nothing has been computed yet.
        SceneError: there is no such column, or it has words.
    """
    there = store.columns_shown()
    for name in filter(None, (quantity, against, by)):
        if name not in there:
            raise SceneError(f"{store.path}: has no column {name}; there are {', '.join(there)}")
    chosen = quantity or next((one for one in ("shields", "safety_factor") if one in there), None)
    if chosen is None:
        raise OutputError(f"{store.path}: no case has been computed; continue with incipient sweep")
    varied_keys = store.keys()
    keys = [key for key in varied_keys if key in there]
    values = ("safety_factor", "shields", "shear_reynolds")
    wanted = dict.fromkeys(filter(None, (chosen, *values, against, by, *keys)))
    names = [name for name in wanted if name in there]
    modes = "mode" in there
    *read, words = store.values([*names, "mode" if modes else names[0]])
    table = {name: _numbers(one) for name, one in zip(names, read, strict=True)}
    for name in filter(None, (quantity, against, by)):
        if np.isnan(table[name]).all():
            raise SceneError(f"{store.path}: {name} is not a number; draw another column")
    varied = [key for key in keys if np.nanmin(table[key]) < np.nanmax(table[key])]
    against = against or next((key for key in varied if key != by), None)
    by = by or next((key for key in varied if key != against), None)
    if against is None:
        raise OutputError(f"{store.path}: no key with numbers varies; give --against COLUMN")
    sources = [str(row["source"]) for row in store.first_of_sources()]
    title = f"{name_of(chosen)} against {name_of(against)}, {_finite(table[chosen]).sum():,} cases"
    found = {chosen: _curves(sources, title, table, (against, chosen, by))}
    if not quantity and {"shields", "shear_reynolds"} <= table.keys():
        found["threshold"] = _shields(sources, table)
    if by is not None and not quantity:
        found["map"] = _map(sources, table, (against, by), words if modes else ())
    return found


def _numbers(values: Any) -> Floats:
    """A column as numbers, NaN for what is none."""
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        return np.array(
            [one if isinstance(one, int | float) else np.nan for one in values], dtype=float
        )


def _finite(values: Floats) -> Any:
    return np.isfinite(values)


def _curves(
    sources: list[str], title: str, table: Columns, names: tuple[str, str, str | None]
) -> Figure:
    figure, axes = figure_of(sources, title, _note())
    across, up, by = names
    x, y = table[across], table[up]
    choose_scale(axes.set_xscale, _ends(x))
    choose_scale(axes.set_yscale, _ends(y))
    for (label, mine), colour in zip(_families(table, by), cycle(COLOURS), strict=False):
        _median(axes, x[mine], y[mine], label, colour)
    if up == "safety_factor":
        axes.axhline(1.0, color=style.INK, lw=0.8, ls=":")
    axes.set(xlabel=name_of(across), ylabel=name_of(up))
    legend(axes, by, AT)
    return figure


def _note() -> str:
    share = f"{BAND[0]:.0%} to {BAND[1]:.0%}"
    return f"Lines: medians of bins; bands: {share} of their cases. Infinite values are left out."


def _ends(values: Floats) -> list[float]:
    """Smallest and largest number."""
    known = values[_finite(values)]
    return [float(known.min()), float(known.max())] if known.size else []


def _families(table: Columns, by: str | None) -> list[tuple[str, Any]]:
    """Cases by the values of a column, or, of many values, by equally large groups of them."""
    if by is None:
        return [("", slice(None))]
    column = table[by]
    values = np.unique(column[_finite(column)])
    if len(values) <= FAMILIES:
        return [(f"{value:.4g}", column == value) for value in values]
    ends = np.quantile(column[_finite(column)], np.linspace(0.0, 1.0, FAMILIES + 1))
    last = [*ends[1:-1], np.inf]
    pairs = zip(ends[:-1], ends[1:], last, strict=True)
    return [
        (f"{low:.4g} to {high:.4g}", (column >= low) & (column < end)) for low, high, end in pairs
    ]


def _binned(values: Floats, number: int, is_logarithmic: bool) -> tuple[Any, Floats]:
    """The bin of each value, and the middles of the bins; few values have one each."""
    distinct = np.unique(values)
    if len(distinct) <= max(FEW, number):
        return np.searchsorted(distinct, values), distinct
    scaled = np.log(values) if is_logarithmic else values
    low, high = scaled.min(), scaled.max()
    middles = low + (np.arange(number) + 0.5) * (high - low) / number
    bins = np.minimum(((scaled - low) * (number / (high - low))).astype(int), number - 1)
    return bins, np.exp(middles) if is_logarithmic else middles


def _median(axes: Axes, x: Floats, y: Floats, label: str, colour: str) -> None:
    """Median and band of y in bins of x."""
    good = _finite(x) & _finite(y)
    x, y = x[good], y[good]
    if not x.size:
        return
    bins, middles = _binned(x, BINS, axes.get_xscale() == "log")
    order = np.lexsort((y, bins))
    y = y[order]
    starts = np.searchsorted(bins[order], np.arange(len(middles) + 1))
    counts = np.diff(starts)
    there = counts >= min(LEAST, counts.max())
    low, median, high = (
        y[starts[:-1][there] + (share * (counts[there] - 1)).round().astype(int)]
        for share in (BAND[0], 0.5, BAND[1])
    )
    axes.fill_between(middles[there], low, high, color=colour, alpha=0.12, lw=0.0)
    axes.plot(middles[there], median, color=colour, lw=1.3, label=label or None)


def _shields(sources: list[str], table: Columns) -> Figure:
    figure, axes = figure_of(sources, "Critical Shields number", f"{_note()} {ONE_GRAIN_AND_BEDS}")
    axes.set(xscale="log", yscale="log")
    good = (table["shields"] > 0.0) & (table["shear_reynolds"] > 0.0)
    _median(
        axes,
        table["shear_reynolds"][good],
        table["shields"][good],
        "one grain, laminar flow",
        COLOURS[0],
    )
    beside_soulsby_whitehouse(axes)
    legend(axes, None, AT)
    return figure


def _map(sources: list[str], table: Columns, names: tuple[str, str], modes: Any) -> Figure:
    """Mean of the logarithm of the safety factor, or Shields number, in cells; marks of the commonest mode in each."""
    value = "safety_factor" if "safety_factor" in table else "shields"
    figure, axes = figure_of(sources, f"Mode and {name_of(value)}")
    x, y = (table[name] for name in names)
    choose_scale(axes.set_xscale, _ends(x))
    choose_scale(axes.set_yscale, _ends(y))
    known = _finite(x) & _finite(y)
    z = table.get(value, np.full(x.shape, np.nan))
    across, middles_x = _binned(x[known], CELLS, axes.get_xscale() == "log")
    up, middles_y = _binned(y[known], CELLS, axes.get_yscale() == "log")
    shape = len(middles_y), len(middles_x)
    cells = up * shape[1] + across
    good = _finite(z[known]) & (z[known] > 0.0)
    counts, sums = (
        np.bincount(cells[good], weights, shape[0] * shape[1]).reshape(shape)
        for weights in (None, np.log10(z[known][good]))
    )
    if counts.any() and min(shape) > 1:
        means = np.ma.masked_where(counts == 0, sums / np.maximum(counts, 1))
        filled = axes.pcolormesh(
            middles_x, middles_y, means, cmap="Greys", alpha=0.6, shading="nearest"
        )
        figure.colorbar(filled, ax=axes, pad=0.02).set_label(f"log10 of the {name_of(value)}, mean")
        if value == "safety_factor" and means.min() < 0.0 < means.max():
            axes.contour(
                middles_x, middles_y, means, levels=[0.0], colors=[style.PUSH], linewidths=1.6
            )
            axes.plot([], [], color=style.PUSH, lw=1.6, label="S = 1")
    _mark_modes(axes, (middles_x, middles_y), cells, modes, known)
    axes.set(xlabel=name_of(names[0]), ylabel=name_of(names[1]))
    legend(axes, None, AT)
    return figure


def _mark_modes(
    axes: Axes, middles: tuple[Floats, Floats], cells: Any, modes: Any, known: Any
) -> None:
    """A small mark in each cell, of the mode that most of its cases have."""
    if not len(modes):
        return
    names = [name for name, _ in Counter(modes).most_common() if name is not None]
    number = {name: n for n, name in enumerate(names)}
    codes = np.fromiter((number.get(mode, -1) for mode in modes), int, len(modes))[known]
    width, size = len(middles[0]), len(middles[0]) * len(middles[1])
    there = codes >= 0
    counts = np.bincount(codes[there] * size + cells[there], minlength=len(names) * size).reshape(
        len(names), size
    )
    commonest = np.where(counts.any(axis=0), counts.argmax(axis=0), -1)
    for n, (name, colour) in enumerate(zip(names, cycle(COLOURS), strict=False)):
        mine = np.flatnonzero(commonest == n)
        if mine.size:
            axes.plot(
                middles[0][mine % width],
                middles[1][mine // width],
                "s",
                color=colour,
                ms=2.0,
                label=str(name),
            )
