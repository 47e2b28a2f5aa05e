"""Pictures of verdicts: of a run, of a single case, and at a threshold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import spatial
from ..contact.safety import NO_FORCE
from ..errors import OutputError
from ..geometry.placement import Placement
from ..geometry.plane.grains import Disc
from ..geometry.space.grains import Sphere
from ..judging.case import Case
from ..results.quantity import at_the_end, ends_at
from ..scene import Scene
from ..scene.grains import mass_and_inertia
from ..thresholds.outcome import with_range
from .drawing import (
    PLANE,
    Sight,
    draw_bed,
    draw_case,
    draw_grain,
    frame,
    render,
)  # fmt: skip
from .flow import draw_streamlines
from .judged import Judged, at_onset, judged, pressed, sentence
from .plane import bed_line, grain_outline, placed_surface
from .record import StoredRun, of_this_version, scene_of
from .style import FLOW, INK, MOTION, RESULTANT, WEIGHT, explain, headline, wrapped

_CRITICAL = {
    "flow over that of the scene": "factor",
    "Shields number, largest diameter": "shields",
    "Reynolds number of the scene": "reynolds",
    "shear Reynolds number": "shear_reynolds",
}
_MOST_CONTACTS = 4
# Colours of numbers that the drawing shows.
_COLOURS = {
    "force of the flow": FLOW,
    "torque about the centre": FLOW,
    "submerged weight": WEIGHT,
    "resultant": RESULTANT,
    "acceleration": MOTION,
    "angular acceleration": MOTION,
}


@dataclass(frozen=True)
class Shape:
    """A placed grain, with or without a bed."""

    grain: Any
    placement: Placement
    bed: Any = None


def of_run(run: StoredRun) -> Figure:
    """Grain on its bed with contacts, forces and torque; verdict in words; numbers."""
    placement = run.placement("centre")
    assert placement is not None
    shape = Shape(run.scene.grain, placement, run.scene.bed and run.scene.bed_shape)
    case = judged(run.result["verdict"])
    verdict, of_the_paper = case.sentences
    verdict = " ".join([verdict, *map(sentence, at_the_end(case.verdict))])
    figure, axes = sheet(case, shape, verdict, of_the_paper, run.headline + run.moment)
    if not run.in_space:
        drawing = axes["drawing"]
        draw_streamlines(run.plane, drawing, (*drawing.get_xlim(), *drawing.get_ylim()), "#9db8cf")
    write_numbers(axes["numbers"], _numbers(case))
    return figure


def _numbers(case: Judged, unit: str = "scene units") -> dict[str, dict[str, Any]]:
    return case.tables(unit) | {"Contacts: normal force, tangential/normal": _contact_rows(case)}


def _contact_rows(case: Judged) -> dict[str, str]:
    rows = {}
    shown = zip(case.states, *pressed(case.forces, case.contacts.normals), strict=True)
    for index, (state, normal, tangential) in enumerate(list(shown)[:_MOST_CONTACTS]):
        name = f"{index + 1}: {state.lower()}"
        name += ", significant" if index in case.significant else ""
        ratio = f",  {tangential / normal:.3f}" if normal > 0.0 else ""
        acts = np.hypot(normal, tangential) > NO_FORCE * case.largest
        rows[name] = f"{normal:.4g}{ratio}" if acts else "0"
    more = len(case.states) - _MOST_CONTACTS
    return rows | ({f"and {more} more": ""} if more > 0 else {})


def sketched(case: Judged) -> Shape:
    """A disc or sphere about the centre through the farthest contact."""
    centre = case.load.centre
    size = 2.0 * float(np.linalg.norm(case.contacts.points - centre, axis=1).max())
    if case.planar:
        return Shape(Disc(size), Placement((centre[0], centre[1])))
    return Shape(Sphere(size), Placement(tuple(centre.tolist())))


def of_judgement(stored: dict[str, Any], directory: Path) -> Figure:
    """Picture of a judged case."""
    case, shape = judged(stored["verdict"]), _shape_of_case(stored, directory)
    chances = stored.get("probabilities")
    more = [case.sentences[1], *([] if chances is None else [sentence(chances["sentence"])])]
    subject = (stored.get("title") or "A case") + ("" if shape else "; the grain is sketched")
    figure, axes = sheet(case, shape, case.sentences[0], " ".join(more), subject)
    if case.planar:
        axes["drawing"].set(xlabel="x", ylabel="y")
    write_numbers(axes["numbers"], _numbers(case, "units of the case"))
    return figure


def _shape_of_case(stored: dict[str, Any], directory: Path) -> Shape | None:
    if stored.get("case") is None:
        return None
    with of_this_version(directory):
        case = Case(**stored["case"])
    return None if case.body is None else Shape(case.body.grain, case.placement)


def of_threshold(stored: dict[str, Any], directory: Path) -> Figure:
    """The grain at the critical flow, and the trials of the search."""
    scene, again = scene_of(directory), "find the threshold again"
    if scene.grain is None or scene.bed is None or scene.placement is None:
        raise OutputError(f"{directory / 'scene.toml'}: has no grain on a bed; {again}")
    case = critical_case(stored, scene)
    tables = _numbers(case)
    shape = Shape(scene.grain, scene.placement, scene.bed_shape)
    words = sentence(f"Threshold: {stored['sentence']}"), case.sentences[1], scene.title
    figure, axes = sheet(case, shape, *words, *(["trials"] if stored["factor"] else []))
    if stored["factor"]:
        numbers = {
            label: "none"
            if stored[key] is None
            else with_range(stored[key], ends_at(key, stored["ranges"]))
            for label, key in _CRITICAL.items()
        }
        numbers["coefficient of static friction"] = f"{case.friction:.4g}"
        (load, *_, contacts) = tables.items()
        tables = {f"Threshold: {stored['mode']}": numbers, **dict((load, contacts))}
        _show_trials(axes["trials"], stored)
    write_numbers(axes["numbers"], tables)
    return figure


def critical_case(stored: dict[str, Any], scene: Scene) -> Judged:
    """The verdict at the threshold with the incipient motion, if there is a threshold."""
    case = judged(stored["verdict"])
    inert = None if scene.body is None else mass_and_inertia(scene.body, scene.placement)
    return at_onset(case, stored["mode"], *inert) if stored["factor"] and inert else case


def _show_trials(axes: Axes, stored: dict[str, Any]) -> None:
    every, critical = stored["trials"], float(stored["factor"])
    trials = np.array(
        sorted((trial["factor"], trial["safety_factor"] or 0.0) for trial in every)
    ).reshape(-1, 2)
    # The flow that represents the Stokes limit is too slow for the axes of the others.
    slowest = 1e-3 * trials[:, 0].max(initial=1.0)
    trials = trials[(trials[:, 0] > slowest) & (trials[:, 1] > 0.0)]
    axes.axhline(1.0, color=INK, lw=0.8)
    axes.plot(*trials.T, "o-", color=FLOW, lw=1.0, ms=4)
    axes.plot(critical, 1.0, "*", color=MOTION, ms=11, mec="white", mew=0.6, zorder=5)
    axes.set(xscale="log", yscale="log")
    axes.tick_params(which="both", labelsize=7)
    axes.set_xlabel("flow over that of the scene", fontsize=7.5, labelpad=1)
    axes.set_title(f"Safety factor, flows solved: {len(every)}", fontsize=8.5)
    axes.grid(color="#e2e2e2", lw=0.5)


def sheet(
    case: Judged, shape: Shape | None, first: str, second: str, subject: str, *panels: str
) -> tuple[Figure, dict[str, Axes]]:
    """Sheet of a verdict with the drawing; axes of further panels beside it, "numbers" the last."""
    figure = Figure(figsize=(9.6, 6.2), layout="constrained")
    headline(figure, first, weight="bold")
    beside = [[name] for name in (*panels, "numbers", "numbers")]
    axes: dict[str, Axes] = figure.subplot_mosaic([["drawing", beside]], width_ratios=(1.75, 1.0))
    about = [*wrapped(second, 5.4, 9), *wrapped(subject, 5.4, 9)]
    axes["drawing"].set_title("\n".join(about), fontsize=9)
    axes["drawing"].set_anchor("W")
    _show(axes["drawing"], case, shape)
    explain(figure, loc="outside lower left", ncols=3)
    return figure, axes


def _show(axes: Axes, case: Judged, shape: Shape | None) -> None:
    load, contacts = case.load, case.contacts
    known, shape = shape is not None, shape or sketched(case)
    planar = case.planar and shape.placement.gdim == 2
    sight = PLANE if planar else Sight.of(load.flow_force, load.weight, contacts.normals)
    if planar:
        places = spatial(grain_outline(shape.grain, shape.placement))
    else:
        places, triangles = placed_surface(shape.grain, shape.placement)
    seen = np.vstack([places, contacts.points])
    size = float(np.ptp(seen if planar else places, axis=0).max())
    frame(axes, sight(seen), size, 0.55 if planar else 0.3)
    if not planar:
        render(axes, sight, places, triangles, shape.bed)
    else:
        if shape.bed is not None:
            draw_bed(axes, bed_line(shape.bed, *axes.get_xlim()))
        draw_grain(axes, sight(places), known)
    draw_case(axes, case, sight, places, size)


def write_numbers(axes: Axes, tables: Mapping[str, Mapping[str, Any]]) -> None:
    """Write tables of numbers by heading and label; long values on lines of their own."""
    lines: list[tuple[str, str]] = []
    for heading, table in tables.items():
        lines += [(heading, "")]
        for name, value in table.items():
            words = _words(value)
            is_long = len(name) + len(words) > 43  # characters in a row
            lines += [(name, ""), ("", words)] if is_long else [(name, words)]
        lines += [("", "")]
    axes.set_axis_off()
    axes.set_ylim(max(len(lines), 21), 0)
    for row, (name, words) in enumerate(lines):
        axes.text(
            0.0, row, name, color=_COLOURS.get(name, INK), fontsize=8, va="top",
            weight="bold" if name in tables else "normal",
        )  # fmt: skip
        axes.text(1.0, row, words, ha="right", fontsize=8, va="top")


def _words(value: Any) -> str:
    """A word, a number, or a vector without round-off."""
    if isinstance(value, str):
        return value
    if np.ndim(value) == 0:
        return "∞" if value == np.inf else f"{value:.4g}".replace("-", "−")
    size = np.abs(value).max(initial=0.0)
    shown = (0.0 if abs(part) <= 1e-9 * size else part for part in value)
    return f"({', '.join(f'{part:.{6 - len(value)}g}' for part in shown)})".replace("-", "−")
