"""The kinds of results that commands write, and their quantities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from . import of_runs
from .quantity import OutputQuantity, at, ends_at

CRITICAL = "critical numbers"  # heading of a page
# Captions of the pictures of runs, each of which has some of them, by name.
OF_RUNS = {
    "verdict": "The verdict: forces on the grain and at its contacts",
    "flow": "Speed and streamlines",
    "pressure": "Pressure",
    "elevation": "The free surface from above",
    "vorticity": "Vorticity",
    "traction": "Traction of the fluid on the grain",
    "trajectory": "Path of the grain",
    "walls": "y+ and friction along the walls",
    "mesh": "The mesh",
}


@dataclass(frozen=True)
class ResultKind:
    """One kind of results.

    name: of its record NAME.json and of its page's template; title: of a page without any
    tables: other files beside the record; pictures: those that are always drawn
    has_scene: whether the directory contains the scene
    quantities: in tables of sweeps and on pages
    """

    name: str
    title: str
    tables: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    has_scene: bool = False
    quantities: tuple[OutputQuantity, ...] = ()

    @property
    def record(self) -> str:
        return f"{self.name}.json"

    @property
    def files(self) -> set[str]:
        return {self.record, *self.tables, *self.pictures}


def _kind(name: str, title: str, *tables: str, **more: Any) -> ResultKind:
    return ResultKind(name, title, tables, (f"{name}.png",), **more)


_bounded = partial(OutputQuantity, unbounded=True, heading=CRITICAL)
_THRESHOLD = (
    OutputQuantity("mode", "mode of incipient motion", column="mode"),
    _bounded(
        "factor",
        "critical flow over that of the scene",
        column="factor",
        ends=partial(ends_at, "ranges.factor"),
    ),
    OutputQuantity("computed", "critical flow for the load without corrections", heading=CRITICAL),
    _bounded(
        "shields",
        "critical Shields number",
        column="shields",
        ends=partial(ends_at, "ranges.shields"),
    ),
    _bounded(
        "shields_nominal",
        "critical Shields number with the nominal diameter",
        column="shields_nominal",
    ),
    _bounded(
        "reynolds",
        "critical Reynolds number of the scene",
        column="reynolds",
        ends=partial(ends_at, "ranges.reynolds"),
    ),
    _bounded(
        "shear_reynolds",
        "shear Reynolds number u* d/ν",
        column="shear_reynolds",
        ends=partial(ends_at, "ranges.shear_reynolds"),
    ),
    OutputQuantity("reason", "why there is no critical flow", column="note"),
)
_GUST = (
    OutputQuantity(
        "strength", "critical strength", column="strength", error="error", unbounded=True
    ),
    *(OutputQuantity(name, name, column=name) for name in ("held", "leaves", "impulse", "runs")),
)
_ENTRAINMENT = (
    OutputQuantity("threshold.mode", "mode of incipient motion", column="mode"),
    OutputQuantity("threshold.shields", "Shields number of steady flow", column="shields"),
    *(
        OutputQuantity(f"scene.{end}", "probability of motion", column=column)
        for end, column in (
            ("probability", "probability"),
            ("low", "probability_low"),
            ("high", "probability_high"),
        )
    ),
    OutputQuantity("scene.rate", "upcrossings per unit time", column="rate"),
)

RUN = ResultKind(
    "result",
    "",
    ("history.csv", "contacts.csv", "fields", "fields.xdmf", "surface", "surface.xdmf"),
    ("flow.png", "pressure.png", "mesh.png"),
    has_scene=True,
    quantities=of_runs.QUANTITIES,
)
THRESHOLD = _kind("threshold", "Critical flow", has_scene=True, quantities=_THRESHOLD)
GUSTS = _kind("gusts", "Critical gusts", "gusts.csv", has_scene=True, quantities=_GUST)
ENTRAINMENT = _kind(
    "entrainment",
    "Motion in a fluctuating flow",
    "entrainment.csv",
    has_scene=True,
    quantities=_ENTRAINMENT,
)
COST = _kind("cost", "What accuracy costs", "cost.csv", has_scene=True)
SURVEY = _kind("survey", "A bed of grains", "grains.csv", "spheres.csv", "survey.vtp")
POSES = _kind("poses", "A grain in many poses", "poses.csv")
JUDGEMENT = _kind("judgement", "A case", quantities=of_runs.VERDICT)
PILE = ResultKind("pile", "Several grains")  # without a picture
SERIES = _kind("series", "A series of loads", "series.csv")
KINDS = (RUN, THRESHOLD, GUSTS, ENTRAINMENT, SURVEY, POSES, JUDGEMENT, PILE, SERIES, COST)


def quantities_of(kind: ResultKind, stored: Mapping[str, Any]) -> tuple[OutputQuantity, ...]:
    """Quantities of a result as plain data."""
    quantiles = (at(stored, "quantiles") or ()) if kind is ENTRAINMENT else ()
    return kind.quantities + tuple(
        OutputQuantity(
            f"quantiles.{number}.shields",
            f"Shields number of the probability {quantile['probability']:g}",
            column=f"shields_at_{quantile['probability']:g}",
            error=f"quantiles.{number}.error",
        )
        for number, quantile in enumerate(quantiles)
    )
