"""Findings of a study, for predictions: the laws of its scene, and solver options that are cheaper."""

from __future__ import annotations

import numpy as np

from ..planning import expense
from . import calibration
from .calibration import Calibration, Findings
from .laws import ErrorLaw, fitted_errors, fitted_time, geometric_mean
from .study import Study


def findings(study: Study) -> Calibration:
    """Findings of a study by its runs solved as the scene says, none without any. Not collective."""
    scene, end = study.scene, study.scene.time.end if study.scene.time else 0.0
    runs = [*(one.run for one in study.judged), study.compared_with]
    own = [run for run in runs if not run.variant.solver]
    if not own:
        return {}
    steps = np.array([end / run.variant.step if run.variant.step else 0.0 for run in own])
    unknowns, cpu = np.array([(run.unknowns, run.cpu) for run in own], dtype=float).T
    found = Findings(
        title=scene.title or "a scene without a title",
        kind=calibration.kind(scene),
        time=fitted_time(unknowns, steps, cpu, min(run.start for run in own)),
        memory=geometric_mean([run.peak_mib / expense.memory(run.unknowns) for run in own]),
        errors={
            goal.name: laws for goal in study.goals if goal.leading and (laws := _errors(study, goal.name))
        },
        cheaper={
            one.solver: one.time_at_error for one in study.solvers() if one.cheaper and one.time_at_error
        },
    )
    return {calibration.digest(scene): found}


def _errors(study: Study, goal: str) -> dict[int, ErrorLaw]:
    """The laws of an error, by the runs that can be told apart from the reference."""
    time, seen = study.scene.time, []
    for one in study.judged:
        variant, error = one.run.variant, one.errors[goal]
        if one.told_apart and not variant.solver and error > 0.0:
            step = calibration.step_of_flow(study.scene, variant.step)
            seen.append((variant.order, variant.mesh_size, step, error))
    return fitted_errors(np.array(seen).reshape(-1, 4), 1.0 if time and time.scheme == "bdf1" else 2.0)
