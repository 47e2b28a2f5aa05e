"""Pictures of verdicts: of a run, of a single case, and at a threshold."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import spatial
from ..contact import Contacts, Load, incipient_motion
from ..errors import ConvergenceError, OutputError, SceneError
from ..geometry.placement import Placement
from ..judging.case import Case
from ..scene import Body
from ..scene.mass import mass_and_inertia
from ..thresholds.outcome import with_error
from .drawing import (
    PLANE,
    Marks,
    Sight,
    draw_bed,
    draw_case,
    draw_directions,
    draw_grain,
    draw_pieces,
    render,
    show_place,
)  # fmt: skip
from .flow import draw_streamlines
from .judged import Judged, Marked, judged, sentence
from .outlines import Solid, bed_line, grain_outline, hull, placed_surface, sketched
from .record import StoredRun, scene_of
from .sheet import (
    Group,
    contact_rows,
    explain,
    judge_rows,
    load_rows,
    number,
    panel,
    sheet,
    write_numbers,
)  # fmt: skip
from .style import FLOW, INK, MOTION, number_plainly

_UNIT = "[scene units]"
_COEFFICIENTS = ("drag", "lift", "moment")
_BEYOND = 1e-4  # how much more than the critical load shows the motion
_SLOWEST = 1e-3  # of the fastest flow: a trial that is shown
_PANEL = 1.5  # height of the trials [inches]


@dataclass(frozen=True)
class Shape:
    """A placed grain, with or without a bed."""

    grain: Any
    placement: Placement
    bed: Any = None


def of_run(run: StoredRun) -> Figure:
    """Grain on its bed with contacts, forces and torque; verdict in words; numbers."""
    stored, scene = run.result.get("verdict"), run.model
    assert run.place is not None
    shape = Shape(scene.grain, run.place, scene.bed_shape)
    case = _unjudged(run) if stored is None else judged(stored, run.directory / "result.json")
    figure, axes = sheet(*case.sentences, run.headline)
    explain(axes, _show(axes, case, shape))
    if not run.in_space:
        draw_streamlines(run.plane, axes, (*axes.get_xlim(), *axes.get_ylim()), "#9db8cf")
    groups = [load_rows(case.acting, case.load.flow_couple, _UNIT, not run.in_space)]
    groups += [] if stored is None else judge_rows(case)
    write_numbers(axes, [*groups, *_flow_rows(run)])
    return figure


def _unjudged(run: StoredRun) -> Judged:
    assert run.place is not None
    listed = run.result.get("contacts") or []
    points, normals = (
        spatial([contact[name] for contact in listed]) if listed else np.empty((0, 3))
        for name in ("point", "normal")
    )
    weight = run.vector("force", "weight") + run.vector("force", "buoyancy")
    flow, torque = run.vector("force", "flow"), run.vector("torque", "flow")
    return Judged(
        load=Load(flow, torque, weight, spatial(run.place.centre)),
        contacts=Marked(points, normals),
        forces=np.zeros((len(listed), 3)),
        states=("NOT_JUDGED",) * len(listed),
        sentences=("The forces on the grain; the scene asks for no verdict.", ""),
    )


def _show(axes: Axes, case: Judged, shape: Shape | None) -> Marks:
    load, contacts = case.load, case.contacts
    planar = case.planar and (shape is None or shape.placement.gdim == 2)
    sight = PLANE if planar else Sight.of(load.flow_force, load.weight, contacts.normals)
    places, triangles = _solid(case, shape, planar)
    bed = None if shape is None else shape.bed
    seen = np.vstack([places, contacts.points])
    size = float(np.ptp(seen if planar else places, axis=0).max())
    x0, x1, _, _ = show_place(axes, sight(seen), size, 0.55 if planar else 0.3)
    if not planar:
        render(axes, sight, places, triangles, bed)
        draw_directions(axes, sight)
    else:
        if bed is not None:
            draw_bed(axes, bed_line(bed, x0, x1))
        draw_grain(axes, sight(places), shape is not None)
    if bed is None:
        draw_pieces(axes, case, sight, size)
    return draw_case(axes, case, sight, places, size)


def _solid(case: Judged, shape: Shape | None, planar: bool) -> Solid:
    flat = np.empty((0, 3), dtype=int)
    if shape is None:
        points, triangles = sketched(case)
        return (spatial(hull(points[:, :2])), flat) if planar else (points, triangles)
    if planar:
        return spatial(grain_outline(shape.grain, shape.placement)), flat
    return placed_surface(shape.grain, shape.placement)


def _flow_rows(run: StoredRun) -> list[Group]:
    closed = bool(run.value("gap", "closed"))
    values = {
        f"{key.capitalize()} coefficient": run.value("coefficients", key) for key in _COEFFICIENTS
    }
    values["Reynolds number"] = run.setting("fluid", "reynolds")
    gap = "Closed where narrower than" if closed else "Gap that stands for contact"
    values[gap] = run.value("gap", "width")
    values["Cells across the gap"] = None if closed else run.value("gap", "cells")
    values["First motion at time"] = run.value("verdict", "first_motion")
    rows = [
        (name, f"{value:.4g}", INK)
        for name, value in values.items()
        if isinstance(value, int | float)
    ]
    return [[("Flow", "", INK), *rows]] if rows else []


def of_judgement(stored: dict[str, Any], directory: Path) -> Figure:
    """Picture of a judged case."""
    source = directory / "judgement.json"
    case, shape = judged(stored["verdict"], source), _shape_of_case(stored, source)
    chances = stored.get("probabilities")
    more = [case.sentences[1], *([] if chances is None else [sentence(chances["sentence"])])]
    subject = (stored.get("title") or "A case") + ("" if shape else "; the grain is sketched")
    figure, axes = sheet(case.sentences[0], " ".join(more), subject)
    explain(axes, _show(axes, case, shape))
    if case.planar:
        axes.set(xlabel="x", ylabel="y")
    there = load_rows(case.acting, case.load.flow_couple, "[units of the case]", case.planar)
    write_numbers(axes, [there, *judge_rows(case), *_probability_rows(chances)])
    return figure


def _shape_of_case(stored: dict[str, Any], source: Path) -> Shape | None:
    try:
        case = None if stored.get("case") is None else Case(**stored["case"])
    except (SceneError, TypeError) as error:
        raise OutputError(
            f"{source}: its case cannot be understood: {error}; judge it again"
        ) from error
    if case is None or case.body is None:
        return None
    return Shape(case.body.grain, case.placement)


def _probability_rows(chances: dict[str, Any] | None) -> list[Group]:
    if chances is None:
        return []
    rows: Group = [("Probability", f"{chances['samples']} samples", INK)]
    likely = sorted(chances["equilibrium"].items(), key=lambda item: -item[1]["value"])
    for mode, chance in likely[:4]:
        rows.append((mode, chance["words"].replace("+-", "±").replace("%", " %"), INK))
    return [rows]


def of_threshold(stored: dict[str, Any], directory: Path) -> Figure:
    """The grain at the critical flow, and the trials of the search."""
    scene, again = scene_of(directory), "find the threshold again"
    if scene.grain is None or scene.bed_shape is None or scene.placement is None:
        raise OutputError(f"{directory / 'scene.toml'}: has no grain on a bed; {again}")
    case = judged(with_motion(stored, scene.body, scene.placement), directory / "threshold.json")
    figure, axes = sheet(critical_sentence(stored), case.sentences[1], scene.title)
    explain(axes, _show(axes, case, Shape(scene.grain, scene.placement, scene.bed_shape)))
    there = load_rows(case.acting, case.load.flow_couple, _UNIT, scene.gdim == 2)
    if not stored["factor"]:
        write_numbers(axes, [there, *judge_rows(case)])
        return figure
    _show_trials(panel(axes, _PANEL), stored)
    groups = [_critical_rows(stored, case.friction), there, contact_rows(case)]
    write_numbers(axes, groups, below=_PANEL + 0.62)
    return figure


def with_motion(
    stored: dict[str, Any], body: Body | None, placement: Placement | None
) -> dict[str, Any]:
    """The verdict at the threshold with the incipient motion, if there is a threshold."""
    verdict = stored["verdict"]
    inert = None if not stored["factor"] or body is None else mass_and_inertia(body, placement)
    motion = None if inert is None else _onset(stored, *inert)
    if motion is None:
        return verdict
    exact = {**verdict["judges"]["equilibrium"], "motion": motion, "mode": stored["mode"]}
    return {**verdict, "judges": {**verdict["judges"], "equilibrium": exact}}


def _onset(stored: dict[str, Any], mass: float, inertia: np.ndarray) -> dict[str, Any] | None:
    acting, at = stored["load"], stored["contacts"]
    friction = float(stored["verdict"]["judges"]["criteria"]["friction"])
    force, torque = (
        (1.0 + _BEYOND) * np.array(acting[name]) for name in ("flow_force", "flow_couple")
    )
    stronger = Load(force, torque, np.array(acting["weight"]), np.array(acting["centre"]))
    contacts = Contacts(at["points"], at["normals"], at["areas"])
    try:
        return incipient_motion(stronger, contacts, friction, mass, inertia).to_dict()
    except ConvergenceError:
        return None


def critical_sentence(stored: dict[str, Any]) -> str:
    """Critical speed of the flow in a sentence, or the reason why there is none."""
    factor, status, mode = stored["factor"], stored["verdict"]["safety_status"], stored["mode"]
    if factor is None and stored["held_to"] is None:
        return "There is no threshold: no strength of this flow moves the grain."
    if factor is None:
        return f"No threshold up to {stored['held_to']:.3g} times the flow of the scene: {stored['reason']}."
    if factor == 0.0 and status == "NO_RESERVE":
        return f"There is no threshold: however weak this flow is, the grain begins {mode}."
    if factor == 0.0 and status == "HELD_BY_FLOW":
        return "There is no threshold: without flow the grain moves, while some flow would hold it."
    if factor == 0.0:
        return f"There is no threshold: without any flow the grain begins {mode}."
    times = _value_with_error(stored, "factor")
    return f"The grain begins {mode} where the flow is {times} times that of the scene."


def _critical_rows(stored: dict[str, Any], friction: float) -> Group:
    rows: Group = [("Threshold", stored["mode"], INK)]
    for name, key in (
        ("Flow over that of the scene", "factor"),
        ("Shields number, largest diameter", "shields"),
        ("Reynolds number of the scene", "reynolds"),
        ("Shear Reynolds number", "shear_reynolds"),
    ):
        rows.append((name, _value_with_error(stored, key), INK))
    return [*rows, ("Coefficient of static friction", number(friction), INK)]


def _value_with_error(stored: dict[str, Any], key: str) -> str:
    if stored[key] is None:
        return "none"
    return with_error(stored[key], stored["errors"][key]).replace("+-", "±")


def _show_trials(axes: Axes, stored: dict[str, Any]) -> None:
    every, critical = stored["trials"], float(stored["factor"])
    solved = sorted((trial["factor"], trial["safety_factor"] or 0.0) for trial in every)
    trials = np.array(solved).reshape(-1, 2)
    # The flow that represents the Stokes limit is too slow for the axes of the others.
    slowest = _SLOWEST * trials[:, 0].max(initial=1.0)
    trials = trials[(trials[:, 0] > slowest) & (trials[:, 1] > 0.0)]
    line = np.unique(np.vstack([trials, [critical, 1.0]]), axis=0)
    axes.axhline(1.0, color=INK, lw=0.8)
    axes.plot(*line.T, color=FLOW, lw=1.0, alpha=0.6)
    axes.plot(*trials.T, "o", color=FLOW, ms=4)
    axes.plot(critical, 1.0, "*", color=MOTION, ms=11, mec="white", mew=0.6, zorder=5)
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        number_plainly(axis)
    axes.tick_params(which="both", labelsize=7)
    axes.set_xlabel("flow over that of the scene", fontsize=7.5, labelpad=1)
    flows = f"{len(every)} flow{'s' if len(every) > 1 else ''}"
    axes.set_title(f"Safety factor, {flows} solved", fontsize=8.5)
    axes.grid(color="#e2e2e2", lw=0.5)
