"""Result of a computed flow: loads, verdict, error bars, cost."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..errors import IncipientError
from ..parallel import from_first
from ..results import of_runs
from ..results.accuracy import Omission
from ..results.errorbars import ErrorBars
from ..results.loads import Gap
from ..results.result import Result, Traction
from ..results.si import in_si
from ..results.timing import peak_memory_mib
from .loads import (
    bar_with_rocking,
    coefficients,
    followed,
    forces_and_torques,
    judged,
    load_of,
    may_rock,
    with_rocking,
)
from .state import Run

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..contact.rocking import Rocking

# Reason for missing error bars until they are estimated.
TO_COME = "not computed: the run has not finished, or was stopped before"


def outcome(run: Run, status: str = "complete", error: str = "") -> Result:
    """Result of the present flow, without error estimates (see `completed`). Collective."""
    from ..mesh.sampling import cells_between, centrelines

    scene, grain = run.scene, run.grain
    reported = {name: value for part in run.parts for name, value in part.reported().items()}
    with run.stage("tractions"):
        force = torque = load = verdict = traction = None
        contacts = run.contacts
        if run.probe is not None:
            force, torque = forces_and_torques(run)
            load = np.concatenate([force.flow, torque.flow])
            traction = Traction(*run.probe.vectors())
            if status == "complete" and grain is None:
                verdict = judged(run, load)
            if grain is not None and (grain.met or grain.does):
                from .landing import landing

                contacts, verdict, why_not = landing(
                    run.setup, grain.state, grain.clearance(), load, grain.does
                )
                reported["trajectory"]["ended"]["without_verdict"] = why_not
        gap, layout = None, run.layout
        if grain is None and layout.gap_ends is not None:
            cells = cells_between(run.domain.mesh, *layout.gap_ends)
            gap = Gap(layout.gap, cells, layout.closing is not None)
        lines = centrelines(scene.domain, run.fluid) if scene.has_centrelines else None
        separated = run.separated()
        measured = {
            quantity.key: quantity.measure(run)
            for quantity in of_runs.QUANTITIES
            if quantity.measure is not None
        }
    return Result(
        title=scene.title,
        plan=run.plan,
        scene=scene.model_dump(mode="json"),
        force=force,
        torque=torque,
        coefficients=None if load is None else coefficients(run, load),
        grain=_grain(run),
        gap=gap,
        contacts=_contacts(contacts),
        verdict=verdict,
        centrelines=lines,
        separated=separated,
        steady=run.steady,
        si=in_si(scene),
        cost=cost(run),
        status=status,
        error=error,
        without_error_bars=scene.no_error_bars
        or (TO_COME if status == "complete" and scene.numerics.error_bars else ""),
        adaptation=run.accounts.adaptation(),
        **reported,
        velocity=run.fluid.velocity,
        pressure=run.fluid.pressure,
        traction=traction,
        measured=measured,
    )


def completed(run: Run, result: Result, bars: ErrorBars | None = None, why: str = "") -> Result:
    """Add error bars, or the reason `why` they are missing, and omitted effects. Collective.

    Loads are corrected for errors of known sign, and rocking is followed.
    """
    from .omitted import omissions

    corrected = result if bars is None else _corrected(run, result, bars.correction)
    rocking = _rocking(run, corrected)
    if rocking is not None and corrected.verdict is not None:
        corrected = replace(corrected, verdict=with_rocking(corrected.verdict, rocking))
        if bars is not None and bars.safety is not None:
            error = bars.total.force, bars.total.torque / run.scene.grain.size
            share = sum(map(np.linalg.norm, error)) / np.linalg.norm(corrected.load[:3])
            drift = rocking.drift(rocking.last)
            safety = bar_with_rocking(bars.safety, rocking.critical, float(share), drift)
            bars = replace(bars, safety=safety)
    with run.stage("omitted effects"):
        try:
            omitted = omissions(run, result)
        except IncipientError as error:
            why_not = f"not estimated: {error}"
            omitted = (Omission("effects named by the plan", None, why_not, False),)
    return replace(
        corrected,
        error_bars=bars,
        without_error_bars=why,
        omitted=omitted,
        cost=cost(run),
        adaptation=run.accounts.adaptation(),
    )


def _corrected(run: Run, result: Result, change: Floats | None) -> Result:
    if change is None or result.force is None or result.torque is None:
        return result
    load = result.load + change
    return replace(
        result,
        force=result.force.corrected(change[:3]),
        torque=result.torque.corrected(change[3:]),
        coefficients=coefficients(run, load),
        verdict=judged(run, load),
    )


def _rocking(run: Run, result: Result) -> Rocking | None:
    """The equilibria of a grain that rocks, if its critical load is larger there. Collective."""
    if result.verdict is None or run.grain is not None or not may_rock(result.verdict):
        return None
    load, first = load_of(run.scene, result.load), result.verdict["safety_factor"]
    run.voice.begin("rests")
    with run.accounts.ledger.stage("contact"):
        # Round-off in the loads may change the number of steps between ranks.
        rocking = from_first(run.comm, lambda: followed(run.scene, load))
    # A critical load larger by less than 1% counts as equal.
    return None if rocking is None or rocking.critical <= 1.01 * first else rocking


def cost(run: Run) -> dict[str, Any]:
    """Wall time by stage and effect, unknowns, iterations, memory, versions. Collective."""
    from .. import compat

    mesh, statistics = run.domain.mesh, run.fluid.solver.statistics
    effects = run.accounts.ledger.by_effect(_unknowns(run))
    for share in effects.values():
        share["memory_mib"] = run.comm.allreduce(share["memory_mib"])
    linear = {
        "factorisations": statistics["factorisations"],
        "krylov": statistics["krylov_iterations"],
    }
    return {
        "wall_time": run.accounts.ledger.to_dict(),
        "effects": effects,
        "unknowns": run.fluid.space.unknowns,
        "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
        "iterations": dict(run.accounts.iterations) | linear,
        "peak_memory_mib": sum(run.comm.allgather(peak_memory_mib())),
        "ranks": run.comm.size,
        "versions": compat.versions(),
    }


def _contacts(contacts: Contacts | None) -> list[dict[str, Any]]:
    if contacts is None:
        return []
    areas = np.zeros(len(contacts.points)) if contacts.areas is None else contacts.areas
    rows = zip(contacts.points, contacts.normals, areas, strict=True)
    return [{"point": list(p), "normal": list(n), "area": float(a)} for p, n, a in rows]


def _grain(run: Run) -> dict[str, Any] | None:
    layout, grain = run.layout, run.scene.grain
    resting, placement = layout.resting, layout.placement
    if run.grain is not None:
        resting = placement = run.grain.state.placement
    if resting is None or placement is None or grain is None:
        return None
    return {
        "centre": resting.centre,
        "computed_centre": placement.centre,
        **(
            {"angle": resting.angle}
            if resting.quaternion is None
            else {"quaternion": resting.quaternion}
        ),
        "size": grain.size,
        "volume": grain.volume,
    }


def _unknowns(run: Run) -> dict[str, int]:
    gdim = run.scene.gdim
    counted: dict[str, int] = {"flow": run.fluid.space.unknowns}
    if run.plan.has("moving mesh"):
        mesh = run.fluid.domain.mesh
        counted["moving mesh"] = int(mesh.geometry.index_map().size_global)
    counted |= {part.effect: part.unknowns for part in run.parts}
    if run.contacts is not None:
        counted["contact"] = gdim * len(run.contacts.points)
    return counted
