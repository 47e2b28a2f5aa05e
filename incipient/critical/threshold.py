"""The critical flow: how fast the scene's flow must be for its grain to begin to move.

The flow is made faster by a factor at the same viscosity, grain and gravity, from rest upwards; the critical factor is
the first one at which the grain is not held any more (`critical.search`). Its error bars follow from those of force and
couple there (`critical.bars`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import spatial
from ..contact import Contacts, Load
from ..errors import IncipientError, SceneError
from ..evaluation.si_units import in_si
from ..interrupt import told_where_kept
from ..planning.flow_setup import Setup
from ..progress import Silent
from ..results.si import si_lines
from ..scene import Scene
from ..scene.units import nominal_diameter
from ..simulation.assemble import TO_COME, cost

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..contact.verdict import Verdict
    from ..results.adaptation import Adaptation
    from ..simulation.state import Run
    from .bars import CriticalBars
    from .search import Found, Search, Trial

SCHEMA_VERSION = 2
SAME_SIZE = 1e-9  # relative
BEYOND = 1e-4  # how much faster than critical a flow is that shows the motion
NOT_ONE = 0.02  # by which the safety factor of a critical flow is off from one on a mesh of its own, told from here on
OTHERWISE = (
    "WARNING: on a mesh made for the critical flow itself the safety factor is {:.3g}, not 1: the mesh is too coarse "
    "for a threshold; use a smaller numerics.mesh_size"
)
# What shields is, and what it is not, beside the number.
SHIELDS = "tau_b/((rho_s - rho_f) g d), d = {size:g}: the largest diameter of the grain; "
NOMINAL = "{shields:.4g} with its nominal diameter {size:.4g}, that of the {what}"
ROUND = "the nominal one is the same"
TURBULENT = "in the mean of a turbulent flow over one grain{plane}, tau_b by the law of the wall; gusts move it sooner"
ROCKED = (
    "before it leaves it rocks, {way}; by the load of the flow past its first pose, off by about {drift:.0%}"
)
OF_ROCKING = "not computed: the grain rocks before it leaves, under a load that is that of the flow past its first pose"
LAMINAR = "in laminar {flow} over one grain{plane}: not a point of Shields' curve, which is of turbulent flow"


@dataclass(frozen=True)
class Threshold:
    """The critical flow of a scene, or why there is none.

    factor:          critical speed over that of the scene; 0: any flow moves it, or its weight alone does;
                     inf: none that was seen moves it
    held_to:         factor up to which the grain is held; inf: it always is
    reason:          why the search ended without a critical flow, or without one solved near it
    shields:         Shields number tau_b / ((rho_s - rho_f) g d), tau_b of the undisturbed flow at its datum
    reynolds:        the scene's Reynolds number, critical
    shear_reynolds:  u* d / nu with u*^2 = tau_b / rho_f
    size:            d, the largest diameter of the grain
    nominal:         its nominal diameter, of the sphere of equal volume, in the plane the disc of equal area
    shields_nominal: the Shields number with that
    notes:           what to know of the critical flow
    mode:            how the grain begins to move, by the exact judge
    load:            the load at the threshold, which the contact forces balance; where any flow moves the grain
                     that of a weak one, where none does that of the strongest one seen
    verdict:         both judges there
    trials:          the flows solved on the way; unsolved: factors at which no steady flow was found
    bars:            error bars of the factor, None: `without_bars` says why, or there is no threshold
    adaptation:      how the mesh was found, None without `numerics.accuracy`
    stress_power:    the power of the factor with which the stress on the bed goes, nearly: two in turbulent flow
    si:              the critical flow and its load in SI units (`results.si`), None without [units]
    """

    factor: float
    held_to: float
    reason: str
    shields: float
    reynolds: float
    shear_reynolds: float
    size: float
    nominal: float
    shields_nominal: float
    notes: tuple[str, ...]
    mode: str
    load: Load
    contact_forces: np.ndarray
    contacts: Contacts
    verdict: dict[str, Any]
    trials: tuple[Trial, ...]
    unsolved: tuple[float, ...]
    cost: dict[str, Any]
    bars: CriticalBars | None = None
    without_bars: str = ""
    adaptation: Adaptation | None = field(default=None)
    si: dict[str, Any] | None = None
    stress_power: float = 1.0

    @property
    def is_critical(self) -> bool:
        """Whether there is a flow at which the grain begins to move."""
        return 0.0 < self.factor < np.inf

    @property
    def errors(self) -> dict[str, float | None]:
        """Absolute errors of factor, shields, reynolds and shear_reynolds; None where they are not known."""
        share = None if self.bars is None or not self.bars.terms else self.bars.error / self.factor
        stress = self.stress_power
        powers = {"factor": 1.0, "shields": stress, "reynolds": 1.0, "shear_reynolds": 0.5 * stress}
        return {
            name: None if share is None else share * power * getattr(self, name)
            for name, power in powers.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data for threshold.json."""
        names = [
            *self.errors,
            "held_to",
            "reason",
            "size",
            "nominal",
            "shields_nominal",
            "notes",
            "errors",
            "mode",
            "verdict",
            "unsolved",
            "cost",
            "si",
        ]
        return {
            **{name: getattr(self, name) for name in names},
            "schema_version": SCHEMA_VERSION,
            "error_bars": self.bars and self.bars.to_dict(),
            "without_error_bars": self.without_bars,
            "adaptation": self.adaptation and self.adaptation.to_dict(),
            "load": asdict(self.load),
            "contacts": {**asdict(self.contacts), "forces": self.contact_forces},
            "trials": [asdict(trial) for trial in self.trials],
        }

    def text(self) -> str:
        """The outcome in a few lines."""
        lines = self._critical_lines() if self.is_critical else [f"threshold           {self.why_none()}"]
        if self.bars is not None:
            lines += self.bars.lines()
        elif self.without_bars:
            lines.append(f"error bars          {self.without_bars}")
        if self.adaptation is not None:
            lines += self.adaptation.lines()
        unsolved = f", {len(self.unsolved)} not found" if self.unsolved else ""
        return "\n".join([*lines, f"flows solved        {len(self.trials)}{unsolved}"])

    def why_none(self) -> str:
        """Why there is no critical flow, in words."""
        if self.factor == 0.0 and self.verdict["safety_status"] == "AT_ONCE":
            return f"zero: any flow moves the grain, {self.mode}"
        if self.factor == 0.0:
            return (
                "none: the grain moves without any flow; with body.settle = true it first rolls and tips to a place "
                "where it rests"
            )
        if not np.isfinite(self.held_to):
            return (
                "none: no strength of this flow moves the grain, whose load grows in proportion (no inertia)"
            )
        tried = f" (tried: {', '.join(f'{one:.3g}' for one in self.unsolved)})" if self.unsolved else ""
        return f"none up to {self.held_to:.3g} times the flow of the scene; {self.reason}{tried}"

    def _critical_lines(self) -> list[str]:
        told = {name: with_error(getattr(self, name), error) for name, error in self.errors.items()}
        return [
            f"threshold           {told['factor']} times the flow of the scene; "
            f"then the grain begins {self.mode}",
            f"Shields number      {told['shields']}",
            *(f"                    {note}" for note in self.notes),
            f"Reynolds number     {told['reynolds']}   shear Reynolds number {told['shear_reynolds']}",
            *si_lines(self.si),
        ]


def with_error(value: float, error: float | None) -> str:
    """A number with its error and no more digits than are certain; four where the error is not known."""
    if error is None:
        return f"{value:.4g}"
    if not np.isfinite(error):
        return f"{value:.2g} (error without bound)"
    if error <= 1e-6 * value:  # digits beyond are those of the search
        return f"{value:.6g}"
    place = int(np.floor(np.log10(error)))
    digits = max(0, (1 if error / 10.0**place < 2.0 else 0) - place)
    shown = np.ceil(error * 10.0**digits) / 10.0**digits
    return f"{value:.{digits}f} +- {shown:.{digits}f}"


def find_threshold(
    scene: Scene,
    comm: MPI.Comm,
    voice: Silent | None = None,
    keep: Callable[[Threshold], Path | None] = lambda threshold: None,
) -> Threshold:
    """Find the critical flow of a scene with a grain resting on a bed. Collective.

    With `numerics.accuracy` the mesh is refined until the error of the critical flow is small enough.

    Args:
        keep: is given the threshold before its error bars are computed; returns where it is kept.

    Raises:
        SceneError: the scene has no weight, friction or bed to judge the grain by, or is time-dependent.
        ConvergenceError: not even the slowest flow could be solved.
    """
    from ..simulation.build import prepared
    from .adaptation import CriticalRefinement
    from .search import Search

    _require(scene)
    if scene.fluid.inertia and scene.effects.inertia == "auto":
        # Where the plan would leave inertia out, it may matter at the threshold.
        scene = scene.model_copy(update={"effects": scene.effects.model_copy(update={"inertia": True})})

    def concluded(run: Run, search: Search, found: Found, adaptation: Adaptation | None = None) -> Threshold:
        """The threshold that a search has found, with error bars where they are wanted; kept before these begin."""
        threshold = _threshold(run, found)
        if found.is_critical:
            threshold = replace(threshold, adaptation=adaptation)
        if not (found.is_critical and run.scene.numerics.error_bars):
            return threshold
        if found.rocking is not None:
            return replace(threshold, without_bars=OF_ROCKING)
        kept = keep(replace(threshold, without_bars=TO_COME))
        with told_where_kept(kept, comm):
            return _with_bars(threshold, run, search, found)

    voice = voice or Silent()
    if scene.numerics.accuracy is not None:
        return CriticalRefinement(scene, comm, voice, concluded).threshold()
    if scene.is_turbulent:
        from .own_mesh import on_its_own_mesh

        return on_its_own_mesh(scene, comm, voice, concluded)
    with prepared(scene, comm, voice=voice) as run:
        search = Search(run)
        return concluded(run, search, search.from_rest())


def _require(scene: Scene) -> None:
    body = scene.body
    needs = (
        (
            body is not None and body.x is not None and scene.bed is not None,
            "a grain that rests on a bed (body.x and [bed])",
        ),
        ((scene.density or 0.0) > 1.0, "a grain denser than the fluid (body.density > 1)"),
        (
            scene.gravity is not None and scene.gravity.acceleration > 0.0,
            "gravity ([gravity] acceleration > 0)",
        ),
        (scene.contact is not None, "friction ([contact] friction)"),
        (scene.time is None, "a steady flow (no [time] section)"),
        (scene.flow.kind != "still", "a flow (flow.kind other than still)"),
        (
            scene.flow.kind != "log-law",
            "a profile that keeps its shape as the flow grows, unlike a log-law; sweep fluid.reynolds instead",
        ),
        (
            scene.numerics.accuracy is None or not scene.is_turbulent,
            "numerics.accuracy left out with turbulence; its error bars tell how accurate it is",
        ),
    )
    for met, need in needs:
        if not met:
            raise SceneError(f"a threshold needs {need}")


def _threshold(run: Run, found: Found) -> Threshold:
    """The threshold without error bars. Collective."""
    scene, load, nominal = run.scene, _load_at(found), nominal_diameter(run.scene.grain)
    critical = _judged(run, found, load)
    stress = found.factor * Setup(scene).bed_stress(found.factor)
    return Threshold(
        factor=found.factor,
        held_to=found.held_to,
        reason=found.reason,
        shields=stress / _stress_unit(scene),
        reynolds=found.factor * scene.fluid.reynolds,
        shear_reynolds=float(np.sqrt(stress) * _size(scene) / scene.viscosity),
        size=_size(scene),
        nominal=nominal,
        shields_nominal=stress / _stress_unit(scene) * _size(scene) / nominal,
        notes=_notes(scene, found),
        mode=_mode(run, found),
        load=load,
        contact_forces=critical.equilibrium.safety.contact_forces,
        contacts=_contacts_at(run, found),
        verdict=critical.to_dict(),
        trials=found.trials,
        unsolved=found.unsolved,
        cost=cost(run),
        si=in_si(scene, found.factor, load.flow_force, load.flow_couple) if found.is_critical else None,
        stress_power=2.0 if scene.is_turbulent else 1.0,
    )


def _with_bars(threshold: Threshold, run: Run, search: Search, found: Found) -> Threshold:
    """The threshold with error bars, or with what kept them from being computed. Collective."""
    from ..accuracy.errorbars import error_terms
    from ..simulation.beside import Beside
    from ..simulation.simulate import loads_of
    from .bars import critical_bars

    with run.stage("error bars"):
        try:
            force, couple = search.at_nearest(found.factor)
            # The flow solved nearest may be far away where the load is in proportion.
            force = replace(force, flow=found.load.flow_force)
            couple = replace(couple, flow=found.load.flow_couple)
            bars = critical_bars(
                found, error_terms(run, force, couple, Beside(run, loads_of, found.factor), found.factor)
            )
        except IncipientError as error:
            return replace(threshold, without_bars=f"not computed: {error}", cost=cost(run))
    return replace(threshold, bars=bars, cost=cost(run))


def _notes(scene: Scene, found: Found) -> tuple[str, ...]:
    """What the Shields number is, and whether the flow can be laminar there. Not collective."""
    from ..effects.turbulence.transition import transition
    from ..planning.numbers import numbers_of

    if not found.is_critical:
        return ()
    plane = " in the plane" if scene.gdim == 2 else ""
    told = TURBULENT if scene.is_turbulent else LAMINAR
    notes = [_shields_note(scene, found), told.format(flow=f"{scene.flow.kind} flow", plane=plane)]
    if turbulent := transition(Setup(scene), numbers_of(Setup(scene)), found.factor):
        notes.append(turbulent.text(" at the threshold"))
    if found.rocking is not None:
        rocking, last = found.rocking, found.rocking.rests[-1]
        notes.append(ROCKED.format(way=rocking.way(last), drift=rocking.drift(last)))
    if found.between is not None:
        low, high = found.between
        notes.append(f"interpolated between {low:.4g} and {high:.4g} times the flow: {found.reason}")
    own = found.own_mesh
    if own is not None and abs(own.safety_factor - 1.0) > NOT_ONE:
        notes.append(OTHERWISE.format(own.safety_factor))
    return tuple(notes)


def _shields_note(scene: Scene, found: Found) -> str:
    """What the Shields number is, and what it is with the nominal diameter."""
    size, nominal = _size(scene), nominal_diameter(scene.grain)
    told = SHIELDS.format(size=size)
    if abs(nominal - size) <= SAME_SIZE * size:
        return told + ROUND
    shields = found.factor * Setup(scene).bed_stress(found.factor) / _stress_unit(scene) * size / nominal
    what = "disc of equal area" if scene.gdim == 2 else "sphere of equal volume"
    return told + NOMINAL.format(shields=shields, size=nominal, what=what)


def _mode(run: Run, found: Found) -> str:
    """How the grain begins to move when the flow is a little faster than critical."""
    if not np.isfinite(found.factor):
        return "rest"
    if found.rocking is not None:
        return found.rocking.mode
    load = found.path.load(found.factor * (1.0 + BEYOND)) if found.factor else found.load
    return _judged(run, found, load).equilibrium.label


def _load_at(found: Found) -> Load:
    """The load at the threshold, of a grain that rocks where it has rocked to."""
    if found.rocking is None:
        return found.load
    centre = spatial(found.rocking.rests[-1].placement.centre)
    return Load(found.load.flow_force, found.load.flow_couple, found.load.weight, centre)


def _contacts_at(run: Run, found: Found) -> Contacts:
    assert run.contacts is not None
    return run.contacts if found.rocking is None else found.rocking.rests[-1].contacts


def _judged(run: Run, found: Found, load: Load) -> Verdict:
    from ..contact.verdict import judge
    from ..evaluation.contact_verdict import mass_and_inertia

    scene, contacts = run.scene, _contacts_at(run, found)
    assert scene.body is not None and scene.contact is not None
    return judge(load, contacts, scene.contact.friction, mass_and_inertia(scene.body, scene.placement))


def _stress_unit(scene: Scene) -> float:
    """(rho_s - rho_f) g d."""
    assert scene.gravity is not None and scene.density is not None
    return (scene.density - 1.0) * scene.gravity.acceleration * _size(scene)


def _size(scene: Scene) -> float:
    assert scene.grain is not None
    return scene.grain.size
