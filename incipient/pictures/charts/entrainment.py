"""The picture of entrainment by gusts: probability of motion at an instant against the Shields number."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from .. import style
from ..record import drawn

_WIDE, _HIGH = 6.4, 4.6  # inches


def draw(directory: Path) -> list[Path]:
    """Draw entrainment.png from the entrainment.json of a directory; raises as `record.drawn`. Not collective."""
    return drawn(directory / "entrainment.json", _figure, "find it again")


def _figure(stored: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(_WIDE, _HIGH), layout="constrained")
    axes = figure.add_subplot()
    names = ("shields", "probability", "low", "high")
    shields, probability, low, high = (
        np.array([one[name] for one in stored["curve"]]) for name in names
    )
    quantiles = stored["quantiles"]
    errors = (
        "all errors"
        if all(one["error"] is not None for one in quantiles)
        else "known errors, not the flow's"
    )
    looks: style.Looks = {"color": style.FLOW, "alpha": 0.25, "linewidth": 0.0}
    axes.fill_between(shields, low, high, label=f"its range by {errors}", **looks)
    axes.plot(shields, probability, color=style.FLOW, label="probability of motion at an instant")
    places, heights = ([one[name] for one in quantiles] for name in ("shields", "probability"))
    looks = {"fmt": "o", "color": style.INK, "markersize": 4, "capsize": 3}
    axes.errorbar(places, heights, xerr=_errors(quantiles), label=f"with {errors}", **looks)
    looks = {"color": style.PUSH, "linestyle": "--", "linewidth": 0.9}
    axes.axvline(stored["threshold"]["shields"], label="a steady flow moves it above", **looks)
    if stored["data"]:
        axes.plot(*np.array(stored["data"]).T, "x", color=style.MOTION, label="measured")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="Shields number of the mean flow [-]",
        ylabel="probability [-]",
    )
    axes.set_ylim(0.5 * min(*probability, *heights), 1.5)
    axes.xaxis.set_minor_locator(LogLocator(subs=(2, 3, 5)))
    axes.xaxis.set_minor_formatter("{x:g}")
    axes.xaxis.set_major_formatter("{x:g}")
    figure.suptitle(
        textwrap.fill(stored["title"] or "Motion in a fluctuating flow", 80), fontsize="medium"
    )
    axes.legend(loc="lower right")
    return figure


def _errors(quantiles: list[dict[str, Any]]) -> np.ndarray:
    """(2, n) errors below and above, none below zero; those without bound are ten times the number."""
    terms = [
        [10.0 * one["shields"] if term is None else term for term in one["terms"].values()]
        for one in quantiles
    ]
    errors = np.array([sum(one) for one in terms])
    return np.array([np.minimum(errors, [0.99 * one["shields"] for one in quantiles]), errors])
