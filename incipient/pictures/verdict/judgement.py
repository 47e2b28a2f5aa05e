"""The picture of a judged case, whose load and contacts were given by hand or by another program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...errors import OutputError, SceneError
from ...simulation.judge_case import Case
from .. import style
from ..record import parsed_json
from ..style import INK
from .judged import Judged, judged, sentence
from .outlines import Outline, Solid, grain_outline, sketched_outline, sketched_solid
from .plane import Marks, draw_case, draw_grain, draw_strips, show_place
from .sheet import Group, explain, judge_rows, load_rows, sheet, write_numbers
from .space import placed_surface, show_judged

_UNIT = "[units of the case]"
_SKETCHED = "; the grain is sketched"


def draw(directory: Path) -> list[Path]:
    """Draw judgement.png from the judgement.json of a directory; raises OutputError. Not collective."""
    source, path = directory / "judgement.json", directory / "judgement.png"
    stored = parsed_json(source)
    if "verdict" not in stored:
        raise OutputError(f"{source}: holds no verdict; judge the case again")
    with style.applied():
        figure = _figure(stored, judged(stored["verdict"], source), shaped_case(stored, source))
        style.save(figure, path)
    return [path]


def shaped_case(stored: dict[str, Any], source: Path) -> Case | None:
    """The case, if the judgement holds it and it gives the grain's shape."""
    given = stored.get("case")
    try:
        case = None if given is None else Case(**given)
    except (SceneError, TypeError) as error:
        raise OutputError(
            f"{source}: its case cannot be understood: {error}; judge it again"
        ) from error
    return None if case is None or case.body is None else case


def _figure(stored: dict[str, Any], case: Judged, shaped: Case | None) -> Figure:
    chances = stored.get("probabilities")
    more = [case.sentences[1]] + ([] if chances is None else [sentence(chances["sentence"])])
    subject = (stored.get("title") or "A case") + ("" if shaped else _SKETCHED)
    figure, axes = sheet(case.sentences[0], " ".join(more), subject)
    if case.planar:
        explain(axes, _show_plane(axes, case, shaped))
    else:
        explain(axes, show_judged(axes, case, *surface_of_case(case, shaped)))
    load_there = load_rows(case.acting, case.load.flow_couple, _UNIT, case.planar)
    write_numbers(axes, [load_there, *judge_rows(case), *_probability_rows(chances)])
    return figure


def _probability_rows(chances: dict[str, Any] | None) -> list[Group]:
    if chances is None:
        return []
    rows: Group = [("Probability", f"{chances['samples']} samples", INK)]
    likely = sorted(chances["equilibrium"].items(), key=lambda item: -item[1]["value"])
    for mode, chance in likely[:4]:
        rows.append((mode, chance["words"].replace("+-", "±").replace("%", " %"), INK))
    return [rows]


def _show_plane(axes: Axes, case: Judged, shaped: Case | None) -> Marks:
    outline = _outline(case, shaped)
    seen = np.vstack([outline, case.contacts.points[:, :2]])
    size = float(np.ptp(seen, axis=0).max())
    show_place(axes, seen, size)
    axes.set(xlabel="x", ylabel="y")
    draw_strips(axes, case, size)
    draw_grain(axes, outline, known=shaped is not None)
    return draw_case(axes, case, outline, size)


def _outline(case: Judged, shaped: Case | None) -> Outline:
    if shaped is None or shaped.body is None:
        return sketched_outline(case)
    return grain_outline(shaped.body.grain(), shaped.placement)


def surface_of_case(case: Judged, shaped: Case | None, coarser: int = 1) -> Solid:
    """The grain's surface at its place, points (n, 3) and triangles (m, 3), coarser than usual by a factor."""
    if shaped is None or shaped.body is None:
        return sketched_solid(case, coarser)
    return placed_surface(shaped.body.grain(), shaped.placement, coarser)
