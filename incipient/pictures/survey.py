"""Picture of a survey, the bed from above and its distributions, and its spheres for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ..arrays import Floats
from ..files import replaced
from . import style
from .record import table


def figure(stored: dict[str, Any], directory: Path) -> Figure:
    """The bed from above and its distributions. Raises OutputError for damaged tables."""
    grains, spheres = _tables(directory)
    sheet = Figure(figsize=(10.0, 7.6), layout="constrained")
    sides = sheet.subplots(2, 2)
    _map(sheet, sides[0, 0], stored, grains, spheres)
    _pivots(sides[0, 1], stored, grains)
    _mobile(sides[1, 0], stored)
    _by_protrusion(sides[1, 1], grains)
    style.headline(sheet, stored["title"] or "A bed of grains")
    return sheet


def _tables(directory: Path) -> tuple[dict[str, Floats], dict[str, Floats]]:
    again = "survey it again"
    grains = table(directory / "grains.csv", again, "loads", "mode")
    return grains, table(directory / "spheres.csv", again)


def _map(
    figure: Figure,
    axes: Axes,
    stored: dict[str, Any],
    grains: dict[str, Floats],
    spheres: dict[str, Floats],
) -> None:
    order = np.argsort(spheres["z"] + 0.5 * spheres["diameter"])
    numbered, label, norm = _coloured(grains)
    values = np.full(len(order), np.nan)
    values[grains["number"].astype(int)] = numbered
    columns = (spheres[name][order] for name in ("x", "y", "diameter"))
    circles = [Circle((a, b), 0.5 * d) for a, b, d in zip(*columns, strict=True)]
    bed = PatchCollection(
        circles, array=np.ma.masked_invalid(values[order]), norm=norm, edgecolors=style.INK,
        cmap=mpl.colormaps["viridis_r"].with_extremes(bad=style.GROUND), linewidths=0.3,
    )  # fmt: skip
    axes.add_collection(bed)
    azimuth = np.radians(stored["request"]["flow"]["azimuth"])
    axes.annotate(
        "flow",
        (0.5 + 0.06 * np.cos(azimuth), 1.1 + 0.06 * np.sin(azimuth)),
        (0.5 - 0.06 * np.cos(azimuth), 1.1 - 0.06 * np.sin(azimuth)),
        xycoords="axes fraction",
        arrowprops={"arrowstyle": "->", "color": style.FLOW},
        color=style.FLOW,
        ha="right",
        va="center",
    )
    axes.set(aspect="equal", xlabel="x [length]", ylabel="y [length]")
    axes.autoscale_view()
    figure.colorbar(bed, ax=axes, label=label, shrink=0.9)


def _coloured(grains: dict[str, Floats]) -> tuple[Floats, str, Normalize]:
    if "stress" in grains and np.isfinite(grains["stress"]).any():
        values = grains["stress"]
        finite = values[np.isfinite(values) & (values > 0.0)]
        return (
            values,
            "critical Shields number, of the median diameter [-]",
            LogNorm(finite.min(), finite.max()),
        )
    values = np.where(grains["carries"] == 0.0, grains["pivot"], np.nan)
    return values, "pivot angle [degrees]", Normalize(0.0, 90.0)


def _pivots(axes: Axes, stored: dict[str, Any], grains: dict[str, Floats]) -> None:
    free = grains["carries"] == 0.0
    sizes = grains["diameter"][free] / stored["bed"]["median_diameter"]
    reduced = np.sort(grains["pivot"][free] * sizes**0.3)
    axes.plot(
        reduced,
        (np.arange(len(reduced)) + 0.5) / len(reduced),
        color=style.FLOW,
        label="free grains",
    )
    axes.plot(
        [row["kirchner"] for row in stored["pivots"]],
        [0.01 * row["percentile"] for row in stored["pivots"]],
        "--",
        color=style.INK,
        label="Kirchner et al. (1990), water-worked mixtures",
    )
    axes.set(
        xlabel="pivot angle times (D/K50)^0.3 [degrees]",
        ylabel="cumulative fraction of free grains [-]",
        xlim=(0.0, 90.0),
        ylim=(0.0, 1.25),
    )
    axes.legend(loc="upper left")


def _mobile(axes: Axes, stored: dict[str, Any]) -> None:
    if stored["mobile"]:
        names = ("shields", "mobile", "low", "high")
        shields, mobile, *ends = np.array([[row[n] for n in names] for row in stored["mobile"]]).T
        axes.fill_between(
            shields, *ends, color=style.FLOW, alpha=0.25, linewidth=0.0,
            label=f"{stored['emulator']['level']:.0%} bars",
        )  # fmt: skip
        axes.plot(shields, mobile, color=style.FLOW, label="this survey")
    known = [row for row in stored["constant_drag"] if row["shields"] is not None]
    axes.plot(
        [row["shields"] for row in known],
        [0.01 * row["percentile"] for row in known],
        "o--",
        color=style.PUSH,
        markersize=3,
        label="drag coefficient 0.76 and a log law",
    )
    axes.set(
        xlabel="Shields number based on the median diameter [-]",
        ylabel="mobile fraction of free grains [-]",
        xscale="log",
        ylim=(0.0, 1.0),
    )
    axes.legend(loc="upper left")


def _by_protrusion(axes: Axes, grains: dict[str, Floats]) -> None:
    free = grains["carries"] == 0.0
    axes.set_xlabel("protrusion above the mean surface [diameters]")
    if "shields" not in grains or not np.isfinite(grains["shields"]).any():
        axes.plot(
            grains["protrusion"][free], grains["pivot"][free], "o", color=style.FLOW, markersize=3
        )
        axes.set_ylabel("pivot angle [degrees]")
        return
    shown = free & np.isfinite(grains["shields"]) & (grains["shields"] > 0.0)
    x, y = grains["protrusion"][shown], grains["shields"][shown]
    low, high = (grains[f"shields_{end}"][shown] for end in ("low", "high"))
    high = np.where(np.isfinite(high), high, 10.0 * y)
    bars = np.clip([y - low, high - y], 0.0, [0.99 * y, np.full_like(y, np.inf)])
    axes.errorbar(x, y, yerr=bars, fmt="o", color=style.FLOW, markersize=3, elinewidth=0.7)
    axes.set(yscale="log", ylabel="critical Shields number [-]")


def for_paraview(directory: Path) -> Path:
    """Write the spheres as triangles with numbers, diameters and thresholds (NaN without one); the path."""
    grains, spheres = _tables(directory)
    centres = pyvista.PolyData(np.column_stack([spheres["x"], spheres["y"], spheres["z"]]))
    centres["number"] = np.arange(centres.n_points, dtype=float)
    centres["diameter"] = spheres["diameter"]
    for name in ("stress", "shields", "rank", "pivot", "protrusion", "carries"):
        values = np.full(centres.n_points, np.nan)
        if name in grains:
            values[grains["number"].astype(int)] = grains[name]
        centres[name] = values
    ball = pyvista.Sphere(radius=0.5, theta_resolution=16, phi_resolution=16)
    balls = centres.glyph(scale="diameter", orient=False, geom=ball)
    path = directory / "survey.vtp"
    with replaced(path, path.with_suffix(".part.vtp")) as part:
        balls.save(part)
    return path
