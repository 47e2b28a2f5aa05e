"""The result of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import refuse_broken
from ..files import plain, plain_fields
from ..planning.plan import Plan
from ..scene import Scene
from ..scene.model import MIRRORED
from ..setup.setup import Setup
from . import of_runs
from .accuracy import Adaptation, Omission
from .errorbars import NO_GRAIN, ErrorBars
from .loads import Coefficients, Elevations, Forces, Gap, Torques, loads_words
from .quantity import (
    gdim_of,
    labelled,
    put,
    remarks,
    screen_lines,
    separation_words,
    trajectory_sentence,
    words_of,
)
from .si import UNITS, si_lines, with_loads
from .timing import cost_lines

if TYPE_CHECKING:
    from ..mesh.sampling import Extremum
    from .wall_report import WallReport

SCHEMA_VERSION = 2


@dataclass(frozen=True)
class FlowAt:
    """The flow at a point: velocity (gdim,), and pressure without its hydrostatic part."""

    velocity: Floats
    pressure: float


@dataclass(frozen=True)
class Traction:
    """Traction on the grain: unordered points (n, gdim) on its surface, and vectors (n, gdim) there.

    Of a symmetric scene they cover the computed half.
    """

    points: Floats
    vectors: Floats


@dataclass(frozen=True)
class Steadied:
    """The end of a run until steady flow.

    change: relative change of the flow in the last step, per unit of time
    asked: the change below which the flow counts as steady
    """

    reached: bool
    time: float
    change: float
    asked: float

    def lines(self) -> list[str]:
        """The outcome as text."""
        rate = f"{self.change:.1e} per unit of time"
        if self.reached:
            return labelled("steady", f"at t = {self.time:.6g}, changing by {rate}")
        above = f"above the requested {self.asked:.1e}: use a later time.end"
        return labelled("NOT steady", f"at t = {self.time:.6g}: it changes by {rate}, {above}")


@dataclass(frozen=True, repr=False)
class Result:
    """The outcome of a run. Vectors have three components in scene units.

    surface, elevations: of a free surface at the stations at the end, and over time
    separated: intervals of x of reverse laminar flow along the bed, the longest first; None: not determined
    si: the flow in SI units (`results.si`), None without [units]
    measured: values that effects measure, by key, None of an absent effect
    """

    title: str
    plan: Plan
    scene: dict[str, Any]
    force: Forces | None
    torque: Torques | None
    coefficients: Coefficients | None
    grain: dict[str, Any] | None
    gap: Gap | None
    contacts: list[dict[str, Any]]
    verdict: dict[str, Any] | None
    centrelines: dict[str, Extremum] | None
    cost: dict[str, Any]
    trajectory: dict[str, Any] | None = None
    error_bars: ErrorBars | None = None
    without_error_bars: str = ""
    surface: dict[str, Any] | None = None
    si: dict[str, Any] | None = None
    adaptation: Adaptation | None = None
    separated: tuple[tuple[float, float], ...] | None = None
    turbulence: WallReport | None = None
    steady: Steadied | None = None
    omitted: tuple[Omission, ...] = ()
    status: str = "complete"
    error: str = ""
    elevations: Elevations | None = field(default=None, repr=False)
    velocity: Any = field(default=None, repr=False)
    pressure: Any = field(default=None, repr=False)
    traction: Traction | None = field(default=None, repr=False)
    measured: dict[str, Any] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        verdict = "" if self.verdict is None else self.verdict["sentence"].partition("; ")[0]
        load = self.load
        acting = loads_words(load[:3], load[3:], self.gdim) if len(load) else ""
        parts = self.title or "untitled", self.status, verdict, acting and f"force {acting}"
        return f"<Result: {'; '.join(filter(None, parts))}>"

    def at(self, points: ArrayLike) -> list[FlowAt | None]:
        """The flow at points (n, gdim), or at one (gdim,); None outside the fluid. Collective.

        The half of a symmetric scene that was not computed is mirrored. Raises SceneError for points of another
        dimension than the scene, or a result without fields.
        """
        places = np.atleast_2d(np.asarray(points, dtype=float))
        shape = f"points of shape {np.shape(points)} do not fit; give an array (n, {self.gdim})"
        refuse_broken(
            (places.ndim != 2 or places.shape[1] != self.gdim, shape),
            (self.velocity is None, "the result has no fields; run the scene to have them"),
        )
        velocity, pressure = self._sampled(places)
        outside = np.isnan(pressure)
        if self.gdim == 3 and outside.any() and Setup(scene := Scene(**self.scene)).symmetric:
            mirrored = places[outside] * MIRRORED + [0.0, 2.0 * scene.domain.middle, 0.0]
            there, pressure[outside] = self._sampled(mirrored)
            velocity[outside] = MIRRORED * there
        return [
            None if np.isnan(p) else FlowAt(v, float(p))
            for v, p in zip(velocity, pressure, strict=True)
        ]

    def _sampled(self, points: Floats) -> tuple[Floats, Floats]:
        from ..mesh.sampling import sample

        return sample(self.velocity, points), sample(self.pressure, points)[:, 0]

    @property
    def load(self) -> Floats:
        """Force and torque (6,) of the flow on the grain; (0,) without one."""
        if self.force is None or self.torque is None:
            return NO_GRAIN
        return np.concatenate([self.force.flow, self.torque.flow])

    @property
    def ended_early(self) -> bool:
        """Whether an event of the grain ended the run, which may resume from a checkpoint."""
        return self.trajectory is not None and self.trajectory["ended"]["by"] != "time"

    @property
    def gdim(self) -> int:
        """Dimension of the scene."""
        return gdim_of({"scene": self.scene})

    def to_dict(self) -> dict[str, Any]:
        """Content of result.json."""
        stored = plain_fields(self) | {"schema_version": SCHEMA_VERSION}
        stored["separated"] = stored["separated"] or None
        for key, value in (self.measured or {}).items():
            put(stored, key, plain(value))
        for quantity in of_runs.QUANTITIES:
            if quantity.derive is not None:
                put(stored, quantity.key, quantity.derive(stored))
        loads = {
            quantity.column: load
            for quantity in of_runs.QUANTITIES
            if quantity.column
            and quantity.unit in UNITS
            and (load := quantity.value(stored)) is not None
        }
        stored["si"] = with_loads(self.si, loads)
        return stored

    def text(self, details: bool = False) -> str:
        """The outcome as text."""
        stored, bars = self.to_dict(), self.error_bars
        said = _verdict(stored)
        if bars is not None and bars.safety is not None:
            said.append(bars.safety.sentence)
        path = [] if self.trajectory is None else [trajectory_sentence(self.trajectory)]
        lines = labelled("motion", *path) + labelled("verdict", *said)
        lines += screen_lines(of_runs.QUANTITIES, stored, details)
        lines += si_lines(stored["si"])
        if bars is not None:
            lines += bars.lines(self.gdim, details)
        elif self.without_error_bars:
            lines += labelled("error bars", self.without_error_bars)
        for part in (self.adaptation, self.turbulence, self.steady, self.gap):
            lines += [] if part is None else part.lines()
        lines += [f"warning             {warning}" for warning in self.plan.warnings]
        if self.surface is not None:
            lines += _levels(self.surface, bars)
        spans = self.separated if self.turbulence is None else self.turbulence.backward or None
        if spans is not None:
            errors = bars and bars.total.others.get("separated")
            lines += labelled("separation", separation_words(spans, errors))
        lines += _effects(self.plan, details)
        lines += [line for omission in self.omitted for line in omission.lines()]
        lines += cost_lines(self.cost.get("effects", {})) if details else []
        return "\n".join(lines)


def _verdict(stored: Mapping[str, Any]) -> list[str]:
    """The verdict of both criteria with remarks, or why there is none, if that does not go without saying."""
    verdict = stored["verdict"]
    if verdict is not None:
        return [*verdict["sentence"].split("; ", 1), *remarks(verdict, stored["scene"])]
    why = without_verdict(stored)
    return [f"none: {why}"] if why else []


def without_verdict(stored: Mapping[str, Any]) -> str:
    """Why a run has no verdict, of a held grain only if a part of what one needs is given, or ""."""
    if stored["trajectory"] is not None:
        return str(stored["trajectory"]["ended"]["without_verdict"])
    body, bed, contact = (stored["scene"].get(section) for section in ("body", "bed", "contact"))
    if body is None or bed is None or (body.get("x") is None and contact is None):
        return ""
    needed = {
        "body.x instead of body.centre": body.get("x"),
        "[contact]": contact,
        "body.density": body.get("mass") if body.get("density") is None else body["density"],
    }
    missing = [key for key, value in needed.items() if value is None]
    return f"it needs {', '.join(missing)}" if missing else ""


def _effects(plan: Plan, details: bool) -> list[str]:
    present, absent = (
        [
            f"{effect.name}: {effect.reason}"
            for effect in plan.effects
            if effect.present is simulated
        ]
        for simulated in (True, False)
    )
    return labelled("simulated", *present) + labelled("absent", *(absent if details else ()))


def _levels(surface: dict[str, Any], bars: ErrorBars | None) -> list[str]:
    at = zip(surface["stations"], surface["elevations"], strict=True)
    lines = [
        f"elevation           {value:+.6g} at {words_of(place, 'length', 2)}" for place, value in at
    ]
    errors = {} if bars is None else bars.total.others
    if "level" in errors:
        both = zip(lines, errors["level"], errors["elevation"], strict=True)
        lines = [f"{line}, within {level:.1e}, in the run {most:.1e}" for line, level, most in both]
    return lines + (labelled("inflow", f"{surface['inflow']:.6g}") if "inflow" in surface else [])
