"""What a run gives back: forces, torques, contacts, verdict, and what they cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import SceneError
from ..planning.flow_setup import Setup
from ..planning.plan import Plan
from ..scene import Scene
from .adaptation import Adaptation
from .cost_of_effects import cost_lines
from .elevations import Elevations
from .errorbars import MOST_SPANS, ErrorBars, Loads, centreline_velocities, longest_first
from .left_out import Omission
from .loads import Coefficients, Couples, Forces, Gap, loads_words
from .quantity import OutputQuantity
from .si import si_lines
from .steady import Steadied
from .trajectory import number_words, place_words, trajectory_lines

if TYPE_CHECKING:
    from ..mesh.sampling import Extremum
    from .wall_report import WallReport

SCHEMA_VERSION = 1
ROUNDING = 1e-12  # of the length of an interval, below which its start is zero in words
# What result.json has under the name and in the form that the result has it.
AS_THEY_ARE = (
    *("title", "status", "error", "scene", "grain", "contacts", "verdict", "trajectory", "cost"),
    *("without_error_bars", "surface", "si"),
)


@dataclass(frozen=True)
class FlowAt:
    """The flow at a point: velocity (gdim,), and pressure without its hydrostatic part."""

    velocity: Floats
    pressure: float


@dataclass(frozen=True)
class Traction:
    """The fluid's traction on the grain: points (n, gdim) on its surface, in no order, and vectors (n, gdim) there.

    Of a scene of which half was computed they are those of that half.
    """

    points: Floats
    vectors: Floats


@dataclass(frozen=True, repr=False)
class Result:
    """The outcome of a run. Vectors have three components in scene units; see `to_dict` for what is stored.

    without_error_bars:     why error bars that are wanted are not there
    surface:                of a free surface its elevations at the stations at the end, and a channel's inflow
    elevations:             those at the stations in the course of the run, which history.csv has
    separated:              intervals of x of reverse laminar flow along the bed, between separation and
                            reattachment; None where that is not looked at
    turbulence:             at the walls of a turbulent flow, None without turbulence
    steady:                 whether a flow became steady that was to, None where that is not asked
    si:                     flow and loads in SI units (`results.si`), None without [units]
    traction:               of the fluid on the grain at the end, None without a grain
    measured:               values of the quantities that the effects measure, None of an effect that is absent
    """

    title: str
    plan: Plan
    scene: dict[str, Any]
    force: Forces | None
    couple: Couples | None
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
    measured: dict[OutputQuantity, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """The outcome on one line."""
        told = [self.title or "untitled", self.status]
        if self.verdict is not None:
            factor = self.verdict["safety_factor"]
            told.append(
                f"{self.verdict['mode']}, safety factor {math.inf if factor is None else factor:.4g}"
            )
        if self.force is not None and self.couple is not None:
            told.append(
                f"force of the flow {loads_words(self.force.flow, self.couple.flow, self.gdim)}"
            )
        return f"<Result: {'; '.join(' '.join(one.split()) for one in told)}>"

    def at(self, points: ArrayLike) -> list[FlowAt | None]:
        """The flow at points (n, gdim), or at one (gdim,); None for each that is outside the fluid. Collective.

        Where half of a scene was computed the other half is its mirror image.

        Raises:
            SceneError: the points have not as many coordinates as the scene, or the result has no fields.
        """
        given = np.atleast_2d(np.asarray(points, dtype=float))
        if given.ndim != 2 or given.shape[1] != self.gdim:
            raise SceneError(
                f"points of shape {np.shape(points)} do not fit; give an array (n, {self.gdim})"
            )
        if self.velocity is None or self.pressure is None:
            raise SceneError("the result has no fields; run the scene to have them")
        velocity, pressure = self._sampled(given)
        if self.gdim == 3 and np.isnan(pressure).any():
            outside = np.flatnonzero(np.isnan(pressure))
            velocity[outside], pressure[outside] = self._mirrored(given[outside])
        return [
            None if np.isnan(p) else FlowAt(v, float(p))
            for v, p in zip(velocity, pressure, strict=True)
        ]

    def _sampled(self, points: Floats) -> tuple[Floats, Floats]:
        from ..mesh.sampling import sample

        return sample(self.velocity, points), sample(self.pressure, points)[:, 0]

    def _mirrored(self, points: Floats) -> tuple[Floats, Floats]:
        """The flow at points of the half that was not computed; nan where there is none."""
        scene = Scene(**self.scene)
        if not Setup(scene).symmetric:
            return np.full(points.shape, np.nan), np.full(len(points), np.nan)
        mirror = np.array([1.0, -1.0, 1.0])
        velocity, pressure = self._sampled(mirror * points + [0.0, 2.0 * scene.domain.middle, 0.0])
        return mirror * velocity, pressure

    @property
    def ended_early(self) -> bool:
        """Whether the run ended because of what its grain had done; with a checkpoint it may resume."""
        return self.trajectory is not None and self.trajectory["ended"]["by"] != "time"

    @property
    def gdim(self) -> int:
        """Dimension of the scene."""
        return 2 if (self.scene.get("domain") or {}).get("width") is None else 3

    def loads_at_end(self) -> Loads:
        """The loads, the place and the elevations that the run has come to."""
        place, path = None, self.trajectory
        if path is not None:
            turned = path["quaternion"] if "quaternion" in path else [path["angle"]]
            place = np.array([*path["place"], *turned])
        size = 1.0 if self.grain is None else self.grain["size"]
        found = Loads.at_the_end(
            self.force, self.couple, place, self.elevations, self.turbulence, size, self.separated
        )
        return replace(found, centreline=centreline_velocities(self.centrelines))

    def to_dict(self) -> dict[str, Any]:
        """Everything but the fields, as result.json holds it."""
        stored: dict[str, Any] = {
            "schema_version": SCHEMA_VERSION,
            **{n: getattr(self, n) for n in AS_THEY_ARE},
            **{quantity.key: value for quantity, value in self.measured.items()},
        }
        stored["plan"] = self.plan.to_dict()
        for name in ("force", "couple", "coefficients", "gap", "steady"):
            part = getattr(self, name)
            stored[name] = None if part is None else asdict(part)
        if self.force is not None and self.couple is not None:
            stored["force"] |= {"total": self.force.total, "computed": self.force.plain}
            stored["couple"]["computed"] = self.couple.plain
        stored["error_bars"] = None if self.error_bars is None else self.error_bars.to_dict()
        stored["adaptation"] = None if self.adaptation is None else self.adaptation.to_dict()
        stored["turbulence"] = None if self.turbulence is None else self.turbulence.to_dict()
        stored["separated"] = longest_first(self.separated).tolist() if self.separated else None
        stored["omitted"] = [omission.to_dict() for omission in self.omitted]
        if self.gap is not None:
            stored["gap"]["resolved"] = self.gap.resolved
        stored["centrelines"] = self.centrelines and {
            k: asdict(e) for k, e in self.centrelines.items()
        }
        return stored

    def text(self) -> str:
        """The outcome in a few lines for a reader."""
        return "\n".join(_lines(self))


def _lines(result: Result) -> list[str]:
    lines, gdim, stored = [], result.gdim, result.to_dict()
    if result.force is not None and result.couple is not None:
        flow = loads_words(result.force.flow, result.couple.flow, gdim)
        lines.append(f"force of the flow   {flow} about the centre of mass")
        lines += _computed(result)
    lines += si_lines(result.si)
    if result.error_bars is not None:
        lines += result.error_bars.lines(gdim)
    elif result.without_error_bars:
        lines.append(f"error bars          {result.without_error_bars}")
    if result.adaptation is not None:
        lines += result.adaptation.lines()
    if result.turbulence is not None:
        bars = result.error_bars or ErrorBars(())
        lines += result.turbulence.lines(bars.shear, bars.separated)
    if result.steady is not None:
        lines.append(result.steady.line())
    if result.coefficients is not None:
        k = result.coefficients
        lines.append(
            f"coefficients        drag {k.drag:.6g}   lift {k.lift:.6g}   moment {k.moment:.6g}"
        )
    numbers = result.plan.numbers
    if numbers is not None and numbers.shields is not None:
        of_shear = f"shear Reynolds number {numbers.shear_reynolds:.4g}"
        lines.append(f"flow over the bed   Shields number {numbers.shields:.4g}, {of_shear}")
    if result.gap is not None and np.isfinite(result.gap.width):
        lines.append(result.gap.line())
    lines += [f"warning             {warning}" for warning in result.plan.warnings]
    if result.trajectory is not None:
        lines += trajectory_lines(result.trajectory)
    if result.surface is not None:
        lines += _levels(result.surface, result.error_bars)
    if result.separated is not None:
        lines.append(_separation(result.separated, result.error_bars))
    for name, extreme in (result.centrelines or {}).items():
        lines.append(f"{name:<20}{extreme.value:.6f}{_within(result)} at {extreme.position:.4f}")
    lines += [
        one.line(stored)
        for one, value in result.measured.items()
        if one.in_text and value is not None
    ]
    if result.verdict is not None:
        said = result.verdict["sentence"].split("; ", 1)
        lines += [f"{'' if row else 'verdict':<20}{part}" for row, part in enumerate(said)]
        if "note" in result.verdict:
            lines.append(f"{'':<20}{result.verdict['note']}")
        elif result.verdict["safety_status"] in ("UNHELD", "HELD_BY_FLOW"):
            lines.append(f"{'':<20}{_without_rest((result.scene.get('body') or {}).get('settle'))}")
    if result.error_bars is not None and result.error_bars.safety is not None:
        lines.append(f"{'':<20}{result.error_bars.safety.sentence()}")
    for omission in result.omitted:
        lines += omission.lines()
    return lines + cost_lines(result.cost.get("effects", {}))


def _computed(result: Result) -> list[str]:
    """The loads as computed, and what they are corrected for."""
    force, couple, bars = result.force, result.couple, result.error_bars
    if force is None or couple is None or bars is None or bars.correction is None:
        return []
    for_each = [
        f"{term.name} {loads_words(term.correction.force + 0.0, term.correction.couple + 0.0, result.gdim, '+.2g')}"
        for term in bars.terms
        if term.correction is not None
    ]
    plain = loads_words(force.plain, couple.plain, result.gdim)
    return [f"{'':<20}computed {plain}", *(f"{'':<20}corrected for {one}" for one in for_each)]


def _within(result: Result) -> str:
    """The error bar of a velocity on the centrelines, where it is known."""
    error = None if result.error_bars is None else result.error_bars.centreline
    return "" if error is None else f", within {float(error.max()):.1e},"


def _separation(spans: Sequence[tuple[float, float]], bars: ErrorBars | None) -> str:
    """Where the flow along the bed separates and reattaches, of the longest place with the errors."""
    errors = None if bars is None else bars.separated
    found = []
    for start, end in longest_first(spans)[:MOST_SPANS]:
        start = start if abs(start) > ROUNDING * (end - start) else 0.0
        found.append(f"x = {place_words(start)} to {place_words(end)}")
    if found and errors is not None:
        found[0] += " (within {:.1e} and {:.1e})".format(*errors)
    return f"{'separation':<20}{', '.join(found) or 'none along the bed'}"


def _without_rest(settled: Any) -> str:
    """What to do about a grain that its weight alone moves."""
    if settled:
        return "it settled on a rougher bed or another slope: see contact.friction and bed.slope"
    return "with body.settle = true it first rolls and tips to a place where it rests"


def _levels(surface: dict[str, Any], bars: ErrorBars | None) -> list[str]:
    """Elevations of a free surface, their errors within the run, and the inflow below it."""
    at = zip(surface["stations"], surface["elevations"], strict=True)
    lines = [f"elevation           {value:+.6g} at {number_words(place)}" for place, value in at]
    if bars is not None and bars.elevation is not None and bars.level is not None:
        errors = zip(lines, bars.level, bars.elevation, strict=True)
        lines = [
            f"{line}, within {level:.1e}, in the run {most:.1e}" for line, level, most in errors
        ]
    return lines + ([f"inflow              {surface['inflow']:.6g}"] if "inflow" in surface else [])
