"""The critical flow: how fast the scene's flow must be for its grain to begin to move.

The flow is made faster by a factor at the same viscosity, grain and gravity, from rest upwards; the critical factor is
the first one at which the grain is not held any more (`critical.search`). Its error bars follow from those of force and
couple there (`critical.bars`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..accuracy.errorbars import error_terms
from ..arrays import spatial
from ..contact import Contacts, Load
from ..contact.verdict import Verdict, judge
from ..effects.known import EFFECTS
from ..errors import IncipientError, SceneError
from ..evaluation.contact_verdict import mass_and_inertia
from ..interrupt import told_where_kept
from ..parallel import Comm
from ..planning.flow_setup import Setup
from ..progress import Silent
from ..results.adaptation import Adaptation
from ..results.si import in_si
from ..scene import Scene
from ..scene.units import nominal_diameter
from ..simulation.assemble import TO_COME, cost
from ..simulation.beside import Beside
from ..simulation.build import prepared
from ..simulation.simulate import improved_loads, loads_of
from ..simulation.state import Run
from .bars import corrected, critical_bars
from .meshes import CriticalRefinement, on_its_own_mesh
from .outcome import DOUBTED, Threshold
from .search import CriticalSearch, Found

KEEPS_SHAPE = "a profile that keeps its shape as the flow grows, unlike a log-law; sweep fluid.reynolds instead"
SAME_SIZE = 1e-9  # relative
BEYOND = 1e-4  # how much faster than critical a flow is that shows the motion
NOT_ONE = 0.02  # deviation from one of the safety factor on a mesh of its own from which on it is reported
OTHERWISE = (
    "WARNING: on a mesh made for the critical flow itself the safety factor is {:.3g}, not 1: the mesh is too coarse "
    "for a threshold; use a smaller numerics.mesh_size"
)
# What shields is, and what it is not, beside the number.
SHIELDS = "tau_b/((rho_s - rho_f) g d), d = {size:g}: the largest diameter of the grain; "
NOMINAL = "{shields:.4g} with its nominal diameter {size:.4g}, that of the {what}"
ROUND = "the nominal one is the same"
ROCKED = "before it leaves it rocks, {way}; by the load of the flow past its first pose, off by about {drift:.0%}"
OF_ROCKING = "not computed: the grain rocks before it leaves, under a load that is that of the flow past its first pose"


def find_threshold(
    scene: Scene,
    comm: Comm,
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
    _require(scene)
    if scene.fluid.inertia and scene.effects.inertia == "auto":
        # Where the plan would leave inertia out, it may matter at the threshold.
        scene = scene.model_copy(
            update={"effects": scene.effects.model_copy(update={"inertia": True})}
        )

    def concluded(
        run: Run, search: CriticalSearch, found: Found, adaptation: Adaptation | None = None
    ) -> Threshold:
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
        return CriticalRefinement(scene, comm, voice, concluded).result()
    if scene.is_averaged:
        return on_its_own_mesh(scene, comm, voice, concluded)
    with prepared(scene, comm, voice=voice) as run:
        search = CriticalSearch(run)
        return concluded(run, search, search.from_rest())


def _require(scene: Scene) -> None:
    body = scene.body
    rests = body is not None and body.x is not None and scene.bed is not None
    falls = scene.gravity is not None and scene.gravity.acceleration > 0.0
    needs = (
        (rests, "a grain that rests on a bed (body.x and [bed])"),
        ((scene.density or 0.0) > 1.0, "a grain denser than the fluid (body.density > 1)"),
        (falls, "gravity ([gravity] acceleration > 0)"),
        (scene.contact is not None, "friction ([contact] friction)"),
        (scene.time is None, "a steady flow (no [time] section)"),
        (scene.flow.kind != "still", "a flow (flow.kind other than still)"),
        (scene.flow.kind != "log-law", KEEPS_SHAPE),
    )
    lacking = [need for met, need in needs if not met]
    setup = Setup(scene)
    for need in lacking or (need for effect in EFFECTS for need in effect.threshold_needs(setup)):
        raise SceneError(f"a threshold needs {need}")


def _threshold(run: Run, found: Found) -> Threshold:
    """The threshold without error bars. Collective."""
    scene, load = run.scene, _load_at(found)
    critical = _judged(run, found, load)
    assert scene.grain is not None
    walls = run.wall_report()
    stress, size = run.setup.bed_stress(found.factor), scene.grain.size
    threshold = Threshold(
        factor=found.factor,
        held_to=found.held_to,
        reason=found.reason,
        shields=stress / run.setup.stress_unit,
        reynolds=found.factor * scene.fluid.reynolds,
        shear_reynolds=float(np.sqrt(stress) * size / scene.viscosity),
        size=size,
        nominal=nominal_diameter(scene.grain),
        notes=(),
        mode=_mode(run, found),
        load=load,
        contact_forces=critical.equilibrium.safety.contact_forces,
        contacts=_contacts_at(run, found),
        verdict=critical.to_dict(),
        trials=found.trials,
        unsolved=found.unsolved,
        cost=cost(run),
        si=in_si(scene, found.factor, load.flow_force, load.flow_couple)
        if found.is_critical
        else None,
        stress_power=2.0 if scene.is_averaged else 1.0,
        steepness=found.path.steepness(found.factor) if found.is_critical else None,
        applicable=walls.applicable if walls is not None and found.is_critical else None,
    )
    return (
        replace(threshold, notes=_notes(run, found, threshold)) if found.is_critical else threshold
    )


def _with_bars(threshold: Threshold, run: Run, search: CriticalSearch, found: Found) -> Threshold:
    """The threshold with error bars, or with what kept them from being computed. Collective."""
    with run.stage("error bars"):
        try:
            force, couple = search.at_nearest(found.factor)
            # The flow solved nearest may be far away where the load is in proportion.
            force = replace(force, flow=found.load.flow_force)
            couple = replace(couple, flow=found.load.flow_couple)
            solve = Beside(run, loads_of, found.factor)
            improve = partial(improved_loads, comm=run.comm, speed=found.factor)
            terms = error_terms(run, force, couple, solve, found.factor, improve)
            found, terms = corrected(found, terms)
            bars = critical_bars(found, terms)
        except IncipientError as error:
            return replace(threshold, without_bars=f"not computed: {error}", cost=cost(run))
    plain, adaptation = threshold.factor, threshold.adaptation
    return replace(_threshold(run, found), computed=plain, adaptation=adaptation, bars=bars)


def _notes(run: Run, found: Found, threshold: Threshold) -> tuple[str, ...]:
    """What the Shields number is, and what effects say of the flow there. Collective."""
    of_effects = [
        note for effect in EFFECTS for note in effect.threshold_notes(run.setup, found.factor)
    ]
    notes = [_shields_note(threshold, run.scene.gdim), *of_effects]
    if (walls := run.wall_report()) is not None and (doubt := walls.doubt):
        notes.append(f"{DOUBTED}{doubt}")
    if found.rocking is not None:
        rocking, last = found.rocking, found.rocking.rests[-1]
        notes.append(ROCKED.format(way=rocking.way(last), drift=rocking.drift(last)))
    if found.between is not None:
        low, high = found.between
        notes.append(
            f"interpolated between {low:.4g} and {high:.4g} times the flow: {found.reason}"
        )
    own = found.own_mesh
    if own is not None and abs(own.safety_factor - 1.0) > NOT_ONE:
        notes.append(OTHERWISE.format(own.safety_factor))
    return tuple(notes)


def _shields_note(threshold: Threshold, gdim: int) -> str:
    """What the Shields number is, and what it is with the nominal diameter."""
    size, nominal = threshold.size, threshold.nominal
    said = SHIELDS.format(size=size)
    if abs(nominal - size) <= SAME_SIZE * size:
        return said + ROUND
    what = "disc of equal area" if gdim == 2 else "sphere of equal volume"
    return said + NOMINAL.format(shields=threshold.shields_nominal, size=nominal, what=what)


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
    scene, contacts = run.scene, _contacts_at(run, found)
    assert scene.body is not None and scene.contact is not None
    return judge(
        load, contacts, scene.contact.friction, mass_and_inertia(scene.body, scene.placement)
    )
