"""The critical flow: the slowest flow, as a multiple of the scene's, that moves the grain; and its error bars.

The safety factor S is 1 there, with a range [S_low, S_high], and nearby proportional to f^-p with the flow's factor f:
the critical factor has the range [f S_low^(1/p), f S_high^(1/p)].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..accuracy.coarse_runs import changed
from ..accuracy.errorbars import error_terms
from ..arrays import Floats, spatial
from ..contact import Contacts
from ..contact.robustness import safety_range
from ..errors import IncipientError, SceneError, refuse_broken
from ..interrupt import told_where_kept
from ..parallel import Comm
from ..planning.effects import threshold_notes
from ..progress import Silent
from ..results.accuracy import Adaptation
from ..results.errorbars import ErrorBars
from ..results.loads import COMPONENTS, columns_of_load
from ..results.si import in_si, with_loads
from ..scene import Scene
from ..scene.units import nominal_diameter
from ..simulation.assemble import TO_COME, cost
from ..simulation.build import prepared
from ..simulation.loads import loads_of_run, verdict_on
from ..simulation.simulate import solved
from ..simulation.state import Recorder, Run
from ..simulation.steady import loads_at
from .meshes import on_its_own_mesh, to_accuracy
from .outcome import DOUBTED, Threshold
from .path import flow_of
from .search import CriticalFlow, CriticalSearch

NOT_ONE = 0.02  # reported deviation of the safety factor on its own mesh from 1
OF_PERIODS = "where the flow oscillates"
FEWEST_PERIODS = 3  # the first holds the transient of the start


def find_threshold(
    scene: Scene,
    comm: Comm,
    voice: Silent | None = None,
    keep: Callable[[Threshold], Path | None] = lambda threshold: None,
) -> Threshold:
    """Find the critical flow of a scene with a grain resting on a bed. Collective.

    With `numerics.accuracy` the mesh is refined until its error is small enough. `keep` is called with the threshold
    before its error bars are estimated, and returns its directory.

    Raises:
        SceneError: a scene without weight, friction or bed, or an unsteady one.
        ConvergenceError: not even the slowest flow converged.
    """
    refuse_unsuitable(scene)
    if scene.fluid.inertia and scene.effects.inertia == "auto":
        # Inertia omitted by the plan may matter at the threshold.
        effects = scene.effects.model_copy(update={"inertia": True})
        scene = scene.model_copy(update={"effects": effects})

    def concluded(
        run: Run, search: CriticalSearch, flow: CriticalFlow, adaptation: Adaptation | None = None
    ) -> Threshold:
        threshold = replace(
            _threshold(run, flow), adaptation=adaptation if flow.is_critical else None
        )
        if not (flow.is_critical and run.scene.numerics.error_bars):
            return threshold
        why = "" if scene.time is None else "not estimated: the flow oscillates"
        if flow.rocking is not None:
            why = "not computed: the grain rocks before it leaves, under the load of the flow past its first pose"
        if why:
            return replace(threshold, without_bars=why)
        with told_where_kept(keep(replace(threshold, without_bars=TO_COME)), comm):
            return _with_bars(threshold, run, search, flow)

    voice = voice or Silent()
    if scene.numerics.accuracy is not None:
        return to_accuracy(scene, comm, voice, concluded)
    if scene.is_averaged:
        return on_its_own_mesh(scene, comm, voice, concluded)
    with prepared(scene, comm, voice=voice) as run:
        search = CriticalSearch(run, loads_at if scene.time is None else loads_of_period)
        return concluded(run, search, search.from_rest())


def refuse_unsuitable(scene: Scene) -> None:
    """Raise SceneError for a scene that has no threshold."""
    body = scene.body
    rests = body is not None and body.x is not None and scene.bed is not None
    falls = scene.gravity is not None and scene.gravity.acceleration > 0.0
    needs = (
        (rests, "a grain that rests on a bed (body.x and [bed])"),
        ((scene.density or 0.0) > 1.0, "a grain denser than the fluid (body.density > 1)"),
        (falls, "gravity ([gravity] acceleration > 0)"),
        (scene.contact is not None, "friction ([contact] friction)"),
        (scene.time is None or scene.flow.oscillates, "a steady flow (no [time] section)"),
        (not scene.moves, 'a held grain (body.motion = "fixed")'),
        (
            scene.time is None or scene.numerics.accuracy is None,
            f"no numerics.accuracy {OF_PERIODS}",
        ),
        (scene.time is None or scene.gusts is None, f"no [gusts] {OF_PERIODS}"),
        (
            scene.time is None or scene.time.end >= FEWEST_PERIODS * scene.flow.cycle,
            f"{FEWEST_PERIODS} or more periods (time.end = {FEWEST_PERIODS * scene.flow.cycle:g} or later)",
        ),
        (
            not scene.flow.is_zero,
            "a fluid that is not at rest (another flow.kind or flow.components)",
        ),
        (
            scene.flow.keeps_shape,
            "a profile that keeps its shape as the flow grows, unlike a log-law; sweep "
            f"{'fluid.reynolds' if scene.units is None else 'units.velocity'} instead",
        ),
        # Meshes follow the speed of the flow.
        (
            not scene.is_averaged or scene.numerics.accuracy is None,
            "numerics.accuracy left out with turbulence; see its error bars",
        ),
    )
    refuse_broken(*((not met, f"a threshold needs {need}") for met, need in needs))


def _threshold(run: Run, flow: CriticalFlow) -> Threshold:
    scene, load, contacts = run.scene, flow.load, run.contacts
    if flow.rocking is not None:  # the pose after rocking
        rest = flow.rocking.rests[-1]
        load, contacts = replace(load, centre=spatial(rest.placement.centre)), rest.contacts
    assert contacts is not None
    critical = verdict_on(scene, contacts, load, scene.placement)
    stress, size = run.setup.bed_stress(flow.factor), scene.grain.size
    threshold = Threshold(
        factor=flow.factor,
        held_to=flow.held_to,
        reason=flow.reason,
        shields=stress / run.setup.stress_unit,
        reynolds=flow.factor * scene.fluid.reynolds,
        shear_reynolds=float(np.sqrt(stress) * size / scene.viscosity),
        size=size,
        nominal=nominal_diameter(scene.grain),
        mode=_mode(run, flow, contacts),
        load=load,
        contact_forces=critical.equilibrium.safety.contact_forces,
        contacts=contacts,
        verdict=critical.to_dict(),
        trials=flow.trials,
        unsolved=flow.unsolved,
        cost=cost(run),
        stress_power=2.0 if scene.is_averaged else 1.0,
    )
    if not flow.is_critical:
        return threshold
    return replace(
        threshold,
        si=with_loads(
            in_si(scene, flow.factor), {"force": load.flow_force, "torque": load.flow_couple}
        ),
        steepness=flow.path.steepness(flow.factor),
        notes=(threshold.shields_note(scene.gdim), *_notes(run, flow)),
    )


def _with_bars(
    threshold: Threshold, run: Run, search: CriticalSearch, flow: CriticalFlow
) -> Threshold:
    with run.stage("error bars"):
        try:
            search.at_nearest(flow.factor)
            # The nearest computed flow may be far away for a proportional load.
            terms = error_terms(run, loads_of_run(run, flow_of(flow.load)), flow.factor)
            flow, terms = corrected(flow, terms)
            bars = critical_bars(flow, terms)
        except IncipientError as error:
            return replace(threshold, without_bars=f"not computed: {error}", cost=cost(run))
    computed, adaptation = threshold.factor, threshold.adaptation
    return replace(_threshold(run, flow), computed=computed, adaptation=adaptation, bars=bars)


def _notes(run: Run, flow: CriticalFlow) -> list[str]:
    notes = [*threshold_notes(run.setup, flow.factor)]
    if (walls := run.wall_report()) is not None and (doubt := walls.doubt):
        notes.append(f"{DOUBTED}{doubt}")
    if flow.rocking is not None:
        rocking, last = flow.rocking, flow.rocking.rests[-1]
        notes.append(
            f"before it leaves it rocks, {rocking.way(last)}; under the load of the flow past its first pose, with an "
            f"error of about {rocking.drift(last):.0%}"
        )
    if flow.between is not None:
        low, high = flow.between
        interpolated = f"interpolated between {low:.4g} and {high:.4g} times the flow"
        notes.append(f"{interpolated}: {flow.reason}")
    if flow.own_mesh is not None and abs(flow.own_mesh.safety_factor - 1.0) > NOT_ONE:
        notes.append(
            "WARNING: on a mesh made for the critical flow itself the safety factor is "
            f"{flow.own_mesh.safety_factor:.3g}, not 1: the mesh is too coarse for a threshold; use a smaller "
            "numerics.mesh_size"
        )
    return notes


def _mode(run: Run, flow: CriticalFlow, contacts: Contacts) -> str:
    if not np.isfinite(flow.factor):
        return "rest"
    if flow.rocking is not None:
        return flow.rocking.mode
    load = flow.path.load(1.0001 * flow.factor) if flow.factor else flow.load
    return verdict_on(run.scene, contacts, load, run.scene.placement).equilibrium.label


# -- error bars ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CriticalBars:
    """Error bars of the critical factor.

    low, high: range with all errors together
    terms:     largest error of each source alone
    loads:     errors of force and torque at the critical flow
    """

    low: float
    high: float
    terms: dict[str, float]
    loads: ErrorBars

    def to_dict(self) -> dict[str, Any]:
        factor = {"low": self.low, "high": self.high, "terms": self.terms}
        return {"factor": factor, "load": self.loads.to_dict()}

    def lines(self) -> list[str]:
        known = ", ".join(f"{name} {error:.1e}" for name, error in self.terms.items())
        missing = self.loads.left_out | {
            name: f"not computed: {why}" for name, why in self.loads.failed.items()
        }
        added = f"absolute errors of that multiple, added in full: {known}"
        lines = [f"error bars          {added if known else 'none is known'}"]
        return lines + [f"  {name:<18}{why}" for name, why in missing.items()]


def critical_bars(flow: CriticalFlow, loads: ErrorBars) -> CriticalBars:
    """Error bars of a critical flow from those of force and torque there."""
    errors = {term.name: term.load for term in loads.terms}
    if flow.own_mesh is not None:
        errors["own mesh"] = flow.own_mesh.change
    ranges = {name: factor_range(flow, error) for name, error in errors.items()}
    low, high = factor_range(flow, sum(errors.values(), np.zeros(6)))
    if flow.between is not None:
        below, above = ranges["search"] = flow.between
        low, high = low + below - flow.factor, high + above - flow.factor
    terms = {name: max(flow.factor - a, b - flow.factor) for name, (a, b) in ranges.items()}
    return CriticalBars(max(low, 0.0), high, terms, loads)


def corrected(flow: CriticalFlow, loads: ErrorBars) -> tuple[CriticalFlow, ErrorBars]:
    """The critical flow of the corrected load, with the error bars of that load.

    The correction is proportional to the factor; without a critical flow nearby both are uncorrected.
    """
    change = loads.correction
    if change is None:
        return flow, loads
    path = replace(flow.path, loads=flow.path.loads + change / flow.factor)
    for width in (0.02, 0.1, 0.3):
        low, high = flow.factor / (1.0 + width), flow.factor * (1.0 + width)
        if path.safety(low) > 1.0 and (factor := path.loss(low, high)) is not None:
            held_to = factor if flow.held_to == flow.factor else flow.held_to
            return replace(flow, factor=factor, path=path, held_to=held_to), loads
    return flow, replace(loads, terms=tuple(term.uncorrected for term in loads.terms))


def factor_range(flow: CriticalFlow, error: Floats) -> tuple[float, float]:
    """Range of the critical factor within an error (6,) of force and torque."""
    path, factor = flow.path, flow.factor
    safety = safety_range(flow.load, path.contacts, path.law, np.diag(error))
    power = path.steepness(factor)
    # A load that does not grow there leaves the factor unknown; where S jumps, only S = 0 and infinity do.
    exponent = 1.0 / min(power, 1e9) if power > 0.0 else math.inf
    low, high = min(safety.low, 1.0), max(safety.high, 1.0)
    return factor * low**exponent, factor * high**exponent


# -- oscillating flow -----------------------------------------------------------------------------------------


def loads_of_period(run: Run, factor: float, start: float = 0.0) -> Floats:
    """Force and torque (instants, 6) in the last period, a step apart, in the scene's flow times a factor. Collective.

    `start` is used by steady flows only. Raises SceneError if the flow does not become periodic.
    """
    from scipy.interpolate import make_interp_spline  # for oscillating flows alone

    flow: Any = run.scene.flow
    velocity, reynolds = flow.velocity, run.scene.fluid.reynolds
    faster = {"flow": {"velocity": factor * velocity}, "fluid": {"reynolds": factor * reynolds}}
    scene, history = changed(run.scene, **faster), Recorder()
    with solved(scene, run.comm, history, accounts=run.accounts):
        pass
    assert scene.time is not None
    columns = [*columns_of_load(np.zeros(6), scene.gdim)]
    times = np.array([row["time"] for row in history.rows])
    loads = np.zeros((len(times), 6))
    loads[:, COMPONENTS[scene.gdim]] = [[row[column] for column in columns] for row in history.rows]
    at, units = make_interp_spline(times, loads, k=1), np.repeat([1.0, scene.grain.size], 3)
    last = times[times > times[-1] - flow.cycle]
    difference = units * (at(last) - at(last - flow.cycle))
    change = np.abs(difference).max() / (np.abs(units * at(last)).max() or 1.0)
    if change > 0.05:
        raise SceneError(
            f"time.end: the loads of the last two periods differ by {change:.0%}; use a later one"
        )
    run.voice.say(f"flow x {factor:.6g}: the last two periods differ by {change:.1e}")
    # Steps that were halved differ from flow to flow.
    number = math.ceil(flow.cycle / scene.time.step * (1.0 - 1e-9))
    return np.asarray(at(times[-1] - flow.cycle * np.arange(number) / number))
