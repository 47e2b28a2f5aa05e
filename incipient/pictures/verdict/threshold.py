"""The picture of a threshold: the grain as it begins to move at the critical flow, and how the flow was found."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ...contact import Contacts, Load, incipient_motion
from ...critical.outcome import with_error
from ...errors import ConvergenceError, OutputError
from ...evaluation.contact_verdict import mass_and_inertia
from ...geometry.placement import Placement
from ...scene import Body, Scene, load
from .. import style
from ..record import parsed_json
from ..style import FLOW, INK, MOTION
from .judged import Judged, judged
from .outlines import bed_line, grain_outline
from .plane import Marks, draw_bed, draw_case, draw_grain, show_place
from .sheet import (
    UP,
    Group,
    contact_rows,
    explain,
    judge_rows,
    load_rows,
    number,
    panel,
    sheet,
    write_numbers,
)
from .space import placed_surface, show_judged

_BEYOND = 1e-4  # how much more than the critical load shows the motion
_SLOWEST = 1e-3  # of the fastest flow, shown
_UP_IN_PLANE, _PANEL = 5.2, 1.5  # of the drawing and of the trials, inches
_UNIT = "[scene units]"


def draw(directory: Path) -> list[Path]:
    """Draw threshold.png from the threshold.json and scene.toml of a directory. Not collective.

    Raises:
        OutputError: when one of them is missing or damaged, or the picture cannot be written.
    """
    source, path = directory / "threshold.json", directory / "threshold.png"
    stored = parsed_json(source)
    scene = _scene(directory / "scene.toml")
    with style.applied():
        figure = _figure(stored, scene, source)
        style.save(figure, path)
    return [path]


def _scene(path: Path) -> Scene:
    if not path.exists():
        raise OutputError(f"{path}: no such file; find the threshold again")
    scene = load(path)
    if scene.grain is None or scene.bed_shape is None:
        raise OutputError(f"{path}: has no grain on a bed; find the threshold again")
    return scene


def _figure(stored: dict[str, Any], scene: Scene, source: Path) -> Figure:
    try:
        case = judged(with_motion(stored, scene.body, scene.placement), source)
        up = {2: _UP_IN_PLANE, 3: UP}[scene.gdim]
        figure, axes = sheet(critical_sentence(stored), case.sentences[1], scene.title, up)
        explain(axes, _draw_place(axes, case, scene.grain, scene.placement, scene.bed_shape))
        load_there = load_rows(case.acting, case.load.flow_couple, _UNIT, planar=scene.gdim == 2)
        if stored["factor"]:
            _show_trials(panel(axes, _PANEL), stored)
            groups = [_critical_rows(stored, case.friction), load_there, contact_rows(case)]
            write_numbers(axes, groups, below=_PANEL + 0.62)
        else:
            write_numbers(axes, [load_there, *judge_rows(case)])
    except KeyError as error:
        raise OutputError(
            f"{source}: holds no {error.args[0]}; find the threshold again"
        ) from error
    except (TypeError, ValueError) as error:
        raise OutputError(
            f"{source}: cannot be understood: {error}; find the threshold again"
        ) from error
    return figure


def _draw_place(axes: Axes, case: Judged, grain: Any, placement: Any, bed: Any) -> Marks:
    """The grain on its bed with what is judged; what the marks mean."""
    if placement.gdim == 3:
        return show_judged(axes, case, *placed_surface(grain, placement), bed)
    outline = grain_outline(grain, placement)
    x0, x1, _, _ = show_place(axes, outline, grain.size)
    draw_bed(axes, bed_line(bed, x0, x1))
    draw_grain(axes, outline)
    return draw_case(axes, case, outline, grain.size)


def with_motion(
    stored: dict[str, Any], body: Body | None, placement: Placement | None
) -> dict[str, Any]:
    """The verdict at the threshold with the motion in which the grain leaves it, if there is a threshold."""
    verdict = stored["verdict"]
    if not stored["factor"]:
        return verdict
    assert body is not None
    inert = mass_and_inertia(body, placement)
    motion = None if inert is None else _onset(stored, *inert)
    if motion is None:
        return verdict
    exact = {**verdict["judges"]["equilibrium"], "motion": motion, "mode": stored["mode"]}
    return {**verdict, "judges": {**verdict["judges"], "equilibrium": exact}}


def _onset(stored: dict[str, Any], mass: float, inertia: np.ndarray) -> dict[str, Any] | None:
    """The incipient motion where the flow is a little stronger than critical."""
    acting, at = stored["load"], stored["contacts"]
    friction = float(stored["verdict"]["judges"]["criteria"]["friction"])
    force, couple = (
        (1.0 + _BEYOND) * np.array(acting[name]) for name in ("flow_force", "flow_couple")
    )
    stronger = Load(force, couple, np.array(acting["weight"]), np.array(acting["centre"]))
    contacts = Contacts(at["points"], at["normals"], at["areas"])
    try:
        return incipient_motion(stronger, contacts, friction, mass, inertia).to_dict()
    except ConvergenceError:
        return None


def critical_sentence(stored: dict[str, Any]) -> str:
    """How fast the flow must be for the grain to move, or why there is no such speed."""
    factor, status = stored["factor"], stored["verdict"]["safety_status"]
    if factor is None and stored["held_to"] is None:
        return "There is no threshold: no strength of this flow moves the grain."
    if factor is None:
        return f"No threshold up to {stored['held_to']:.3g} times the flow of the scene: {stored['reason']}."
    if factor == 0.0 and status == "NO_RESERVE":
        return (
            f"There is no threshold: however weak this flow is, the grain begins {stored['mode']}."
        )
    if factor == 0.0 and status == "HELD_BY_FLOW":
        return "There is no threshold: without flow the grain moves, while some flow would hold it."
    if factor == 0.0:
        return f"There is no threshold: without any flow the grain begins {stored['mode']}."
    factor = _value_with_error(stored, "factor")
    return f"The grain begins {stored['mode']} where the flow is {factor} times that of the scene."


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
    """A number of the threshold with its error, none where there is no threshold."""
    if stored[key] is None:
        return "none"
    return with_error(stored[key], stored["errors"][key]).replace("+-", "\N{PLUS-MINUS SIGN}")


def _show_trials(axes: Axes, stored: dict[str, Any]) -> None:
    """The safety factor against the strength of the flow, both on logarithmic scales."""
    solved = [(t["factor"], t["safety_factor"]) for t in stored["trials"] if t["safety_factor"]]
    fastest = max((t["factor"] for t in stored["trials"]), default=1.0)
    # The flow that stands for that of Stokes is too slow to be shown beside the others.
    trials = sorted(pair for pair in solved if pair[0] > _SLOWEST * fastest)
    axes.set_title(f"Safety factor, {_counted(len(stored['trials']))} solved", fontsize=8.5)
    axes.tick_params(labelsize=7)
    _plot_trials(axes, np.array(trials).reshape(-1, 2), float(stored["factor"]))


def _plot_trials(axes: Axes, trials: np.ndarray, critical: float) -> None:
    shown = np.unique(np.vstack([trials, [critical, 1.0]]), axis=0)
    axes.axhline(1.0, color=INK, lw=0.8)
    axes.plot(*shown.T, color=FLOW, lw=1.0, alpha=0.6)
    axes.plot(*trials.T, "o", color=FLOW, ms=4)
    axes.plot(critical, 1.0, "*", color=MOTION, ms=11, mec="white", mew=0.6, zorder=5)
    axes.set(xscale="log", yscale="log")
    for axis, values in ((axes.xaxis, shown[:, 0]), (axes.yaxis, shown[:, 1])):
        _label_round_numbers(axis, values)
    axes.set_xlabel("flow over that of the scene", fontsize=7.5, labelpad=1)
    axes.grid(color="#e2e2e2", lw=0.5)


def _label_round_numbers(axis: Any, values: np.ndarray) -> None:
    """1, 2, 5 of every power of ten in the range of values, which is widened to hold some of them."""
    low, high = values.min() / 1.4, values.max() * 1.4
    powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    digits = (1, 2, 5) if high < 200 * low else (1,)
    ticks = [d * p for p in powers for d in digits if low <= d * p <= high]
    axis.set_view_interval(low, high, ignore=True)
    axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_minor_locator(NullLocator())


def _counted(count: int) -> str:
    return f"{count} flow" + ("s" if count > 1 else "")
