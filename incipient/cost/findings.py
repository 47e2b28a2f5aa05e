"""What a study has found, for predictions: the laws of its scene, and solver options that are cheaper."""

from __future__ import annotations

import math

import numpy as np

from ..planning import meshing
from . import calibration
from .calibration import Calibration, Findings
from .laws import ErrorLaw, fitted_errors, fitted_time
from .measurement import MeasuredRun
from .study import Study


def findings(study: Study) -> Calibration:
    """What is kept of a study: by runs solved as the scene says, nothing without any. Not collective."""
    scene, end = study.scene, study.scene.time.end if study.scene.time else 0.0
    runs = [*(one.run for one in study.judged), study.compared_with]
    own = [run for run in runs if not run.variant.solver]
    if not own:
        return {}
    steps = [end / run.variant.step if run.variant.step else 0.0 for run in own]
    unknowns, cpu = (
        np.array([getattr(run, name) for run in own], dtype=float) for name in ("unknowns", "cpu")
    )
    found = Findings(
        title=scene.title or "a scene without a title",
        kind=calibration.kind(scene),
        time=fitted_time(unknowns, np.array(steps), cpu, min(run.start for run in own)),
        memory=math.exp(float(np.mean([math.log(_memory(run)) for run in own]))),
        errors={
            goal.name: laws for goal in study.goals if goal.leading and (laws := _errors(study, goal.name))
        },
        cheaper={
            one.solver: one.time_at_error for one in study.solvers() if one.cheaper and one.time_at_error
        },
    )
    return {calibration.digest(scene): found}


def _memory(run: MeasuredRun) -> float:
    """Measured over expected memory."""
    return run.peak_mib / meshing.memory(run.unknowns)


def _errors(study: Study, goal: str) -> dict[int, ErrorLaw]:
    """The laws of an error, by the runs that can be told apart from the reference."""
    scene, variants = (
        study.scene,
        [one for one in study.judged if one.told_apart and not one.run.variant.solver],
    )
    seen = [
        (
            one.run.variant.order,
            one.run.variant.mesh_size,
            calibration.step_of_flow(scene, one.run.variant.step),
            one.errors[goal],
        )
        for one in variants
        if one.errors[goal] > 0.0
    ]
    return fitted_errors(
        np.array(seen).reshape(-1, 4), 1.0 if scene.time and scene.time.scheme == "bdf1" else 2.0
    )
