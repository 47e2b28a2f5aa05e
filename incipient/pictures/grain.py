"""Pictures of the grain: the traction on its surface, and the verdict with the forces behind it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon

from .flow import draw_solids, draw_streamlines
from .record import Run
from .style import FLOW, GRAIN, INK, PAPER, PULL, PUSH, REACTION, RESULTANT, WEIGHT, View
from .surface import Surface

_ARROWS = 64
_LONGEST = 0.75  # arrow of a traction, in grain sizes
_STRONGEST = 0.85  # arrow of a force, in grain sizes
_NAMES = {"flow": "Force of the flow", "weight": "Weight less buoyancy", "resultant": "Resultant"}

Row = tuple[str, str, str]  # name, value, colour of the name


def traction(run: Run) -> Figure:
    """Arrows of the traction on the grain's surface, and its components around the grain."""
    surface = _surface(run)
    figure = Figure(figsize=(9.4, 4.7))
    figure.text(0.07, 0.965, f"{run.title}: traction of the fluid on the grain", fontsize=11, va="top")
    _show_arrows(run, figure.add_axes((0.07, 0.11, 0.44, 0.73)), surface)
    _show_components(run, figure.add_axes((0.61, 0.11, 0.37, 0.73)), surface)
    return figure


def verdict(run: Run) -> Figure:
    """The grain on its bed with contacts, forces and couple; the verdict in words; the numbers behind it."""
    surface = _surface(run)
    figure = Figure(figsize=(9.4, 5.0))
    figure.text(0.06, 0.965, _sentence(run), fontsize=11.5, va="top", weight="bold", linespacing=1.25)
    axes = figure.add_axes((0.06, 0.1, 0.58, 0.76))
    view = _show_place(run, axes, surface)
    draw_streamlines(run, axes, view, color="#9db8cf", alpha=0.55)
    axes.add_artist(Polygon(surface.points, facecolor=GRAIN, edgecolor=INK, lw=1.2, zorder=4))
    _show_contacts(run, axes, surface.size)
    _show_couple(run, axes, surface)
    _show_forces(run, axes, surface)
    _write_numbers(run, figure)
    _explain_marks(run, axes)
    axes.set_title(run.headline)
    return figure


def _surface(run: Run) -> Surface:
    if run.surface is None:
        raise ValueError("a run without a grain has no picture of it")
    return Surface.of(run.surface)


def _show_place(run: Run, axes: Axes, surface: Surface) -> View:
    """Make the axes show the grain true to scale with the solids, more of the fluid than of the ground."""
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    y0, y1 = low[1] - 0.6 * surface.size, high[1] + 0.95 * surface.size
    half, middle = (y1 - y0) * axes.bbox.width / axes.bbox.height / 2, (low[0] + high[0]) / 2
    view = (middle - half, middle + half, y0, y1)
    axes.set(xlim=view[:2], ylim=view[2:], xlabel="x [scene units]", ylabel="y [scene units]")
    draw_solids(run, axes, fluid_shown=False)
    return view


def _show_arrows(run: Run, axes: Axes, surface: Surface) -> None:
    """Pressing tractions end on the surface, pulling ones start there: all stand outside the grain."""
    view = _show_place(run, axes, surface)
    chosen = surface.spaced(_ARROWS)
    tractions = surface.tractions[chosen]
    strength = np.linalg.norm(tractions, axis=1)
    longest = float(np.percentile(strength, 95)) or 1.0
    shown = tractions * np.minimum(1.0, 1.3 * longest / np.maximum(strength, 1e-300))[:, None]
    pressed = surface.normal_part[chosen] < 0
    scale = longest / (_LONGEST * surface.size)
    for which, pivot, colour in ((pressed, "tip", PUSH), (~pressed, "tail", PULL)):
        axes.quiver(
            *surface.points[chosen][which].T, *shown[which].T, pivot=pivot, color=colour, angles="xy",
            scale_units="xy", scale=scale, width=0.0045, headwidth=4, headlength=5, zorder=5,
        )  # fmt: skip
    _explain_arrows(axes, view, _rounded(longest), scale)


def _explain_arrows(axes: Axes, view: View, unit: float, scale: float) -> None:
    """The two colours above the axes, and an arrow of a round length with its value in the upper left."""
    marks = [Line2D([], [], color=colour, lw=2) for colour in (PUSH, PULL)]
    labels = ["presses on the grain", "pulls at the grain"]
    axes.legend(marks, labels, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, ncols=2)
    x0, x1, y0, y1 = view
    tail = np.array([x0 + 0.03 * (x1 - x0), y1 - 0.05 * (y1 - y0)])
    tip = tail + np.array([unit / scale, 0.0])
    _arrow(axes, tail, tip, INK, 1.4)
    axes.text(tip[0] + 0.02 * (x1 - x0), tip[1], f"{unit:g} scene units", va="center", bbox=PAPER)


def _show_components(run: Run, axes: Axes, surface: Surface) -> None:
    angles = surface.angles(_centre(run, surface))
    order = np.argsort(angles)
    for part, colour, label in (
        (surface.normal_part, PUSH, "along the outward normal (negative: pressed)"),
        (surface.tangential_part, PULL, "along the surface, anticlockwise"),
    ):
        axes.plot(angles[order], part[order], color=colour, lw=1.3, label=label)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set(xlim=(0, 360), xlabel="direction from the grain's centre [degrees]")
    axes.set_ylabel("traction [scene units]")
    axes.set_xticks([0, 90, 180, 270, 360], ["0\n+x", "90\n+y", "180\n−x", "270\n−y", "360\n+x"])
    axes.grid(color="#dddddd", lw=0.5)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)


def _centre(run: Run, surface: Surface) -> np.ndarray:
    centre = run.found("grain", "centre")
    return surface.points.mean(axis=0) if centre is None else np.array(centre[:2], dtype=float)


def _sentence(run: Run) -> str:
    said = run.found("verdict", "sentence") or "the forces on the grain; the scene asks for no verdict"
    said = said.split("; by the paper")[0]  # the other judge's opinion is in the result
    return "\n".join(textwrap.wrap(f"{said[0].upper()}{said[1:].rstrip('.')}.", 92))


def _rounded(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, 50... (and their thousandths) that does not exceed a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-12)))


def _forces(run: Run) -> dict[str, tuple[np.ndarray, str]]:
    """Forces on the grain other than the bed's, with their colours; the flow's alone without gravity."""
    flow = run.vector("force", "flow")
    weight = run.vector("force", "weight") + run.vector("force", "buoyancy")
    if not weight.any():
        return {"flow": (flow, FLOW)}
    return {"flow": (flow, FLOW), "weight": (weight, WEIGHT), "resultant": (flow + weight, RESULTANT)}


def _show_forces(run: Run, axes: Axes, surface: Surface) -> None:
    """Arrows from the centre, all to one scale; forces too small to see are left to the numbers."""
    forces = _forces(run)
    longest = max(float(np.linalg.norm(force)) for force, _ in forces.values())
    visible = {k: f for k, (f, _) in forces.items() if longest and np.linalg.norm(f) > 0.03 * longest}
    centre = _centre(run, surface)
    for name, force in visible.items():
        colour, along = forces[name][1], force / np.linalg.norm(force)
        tip = centre + _STRONGEST * surface.size * force / longest
        _arrow(axes, centre, tip, colour, 2.6 if name == "resultant" else 1.8)
        others = [other for key, other in visible.items() if key != name]
        _label(axes, tip + 0.05 * surface.size * along, along + _aside(along, others), name, colour)
    axes.plot(*centre, "o", color=INK, ms=3.5, zorder=9)


def _aside(along: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """Unit vector across an arrow's direction, away from another that runs close to it; zero if none does."""
    across = np.array([-along[1], along[0]])
    close = [f for f in others if along @ f > 0.8 * np.linalg.norm(f)]
    return -np.sign(across @ close[0]) * across if close else np.zeros(2)


def _label(axes: Axes, place: np.ndarray, direction: np.ndarray, text: str, colour: str) -> None:
    """Text that leads away from a place in a direction, so that it does not cover what ends there."""
    across, up = direction / np.linalg.norm(direction)
    beside = "left" if across > 0.35 else "right" if across < -0.35 else "center"
    above = "bottom" if up > 0.8 else "top" if up < -0.8 else "center"
    axes.text(place[0], place[1], text, color=colour, ha=beside, va=above, zorder=8, bbox=PAPER)


def _arrow(
    axes: Axes, tail: np.ndarray, tip: np.ndarray, colour: str, width: float, bend: float = 0.0
) -> None:
    arrow = FancyArrowPatch(
        (tail[0], tail[1]), (tip[0], tip[1]), arrowstyle="-|>", mutation_scale=13, color=colour, lw=width,
        shrinkA=0, shrinkB=0, zorder=7, connectionstyle=f"arc3,rad={bend}",
    )  # fmt: skip
    axes.add_artist(arrow)


def _show_couple(run: Run, axes: Axes, surface: Surface) -> None:
    """An arc in the sense of the flow's couple about the centre."""
    couple = run.found("couple", "flow", (0.0, 0.0, 0.0))[2]
    if abs(couple) <= 1e-3 * surface.size * np.linalg.norm(run.vector("force", "flow")):
        return
    sense = float(np.sign(couple))
    ends = np.radians(90 + sense * np.array([-50, 50]))
    around = _centre(run, surface) + 0.3 * surface.size * np.column_stack([np.cos(ends), np.sin(ends)])
    _arrow(axes, around[0], around[1], FLOW, 1.3, bend=sense * 0.45)


def _show_contacts(run: Run, axes: Axes, size: float) -> None:
    """Contact points with their normals into the bed; the significant reaction surface stands out."""
    for point, normal, significant in run.contacts:
        colour, radius = (REACTION, 8) if significant else (INK, 5)
        end = point + 0.3 * size * normal
        axes.plot([point[0], end[0]], [point[1], end[1]], "--", color=colour, lw=1.1, zorder=6)
        axes.plot(*point, "o", color=colour, ms=radius, mec="white", mew=0.8, zorder=8)


def _explain_marks(run: Run, axes: Axes) -> None:
    """What the marks of the contacts mean, beside the axes at the bottom."""
    present = {significant for _, _, significant in run.contacts}
    rows = [(REACTION, 8, "significant reaction surface")] * (True in present)
    rows += [(INK, 5, "contact")] * (False in present)
    marks = [
        Line2D([], [], color=colour, ls="--", lw=1.1, marker="o", ms=radius, mec="white")
        for colour, radius, _ in rows
    ]
    labels = [f"{text}, with its normal" for _, _, text in rows]
    axes.legend(
        marks, labels, loc="lower left", bbox_to_anchor=(1.03, -0.02), borderaxespad=0, handlelength=3
    )


def _write_numbers(run: Run, figure: Figure) -> None:
    """Key numbers in a column on the right, grouped."""
    row, step = 0.84, 0.041
    for group in filter(None, _numbers(run)):
        for name, value, colour in group:
            figure.text(0.67, row, name, color=colour, fontsize=8.5)
            figure.text(0.985, row, value.replace("-", "−"), fontsize=8.5, ha="right")
            row -= step
        row -= 0.5 * step


def _numbers(run: Run) -> Iterator[list[Row]]:
    forces = [(_NAMES[name], _pair(force), colour) for name, (force, colour) in _forces(run).items()]
    couple = f"{run.found('couple', 'flow', (0.0, 0.0, 0.0))[2]:.4g}"
    yield [
        ("Forces and couples", "[scene units]", INK),
        *forces,
        ("Couple of the flow about the centre", couple, FLOW),
    ]
    if "force" in run.criteria and "couple" in run.criteria:
        yield [
            ("Force left by reaction and friction", _pair(run.criteria["force"]), INK),
            ("Couple left by them", f"{run.criteria['couple'][2]:.4g}", INK),
        ]
    coefficients = {key: f"{key.capitalize()} coefficient" for key in ("drag", "lift", "moment")}
    yield _present(run.result, "coefficients", coefficients)
    reynolds = _present(run.scene, "fluid", {"reynolds": "Reynolds number"})
    yield reynolds + _present(run.scene, "contact", {"friction": "Coefficient of static friction"})
    yield _present(run.result, "verdict", {"safety_factor": "Safety factor on the flow"})
    yield _present(
        run.result, "gap", {"width": "Gap that stands for contact", "cells": "Cells across the gap"}
    )


def _pair(vector: Sequence[float] | np.ndarray) -> str:
    return f"({vector[0]:.4g}, {vector[1]:.4g})"


def _present(data: dict, section: str, names: dict[str, str]) -> list[Row]:
    """Rows of those numbers that a section holds."""
    values = ((name, (data.get(section) or {}).get(key)) for key, name in names.items())
    return [(name, f"{value:.4g}", INK) for name, value in values if isinstance(value, (int, float))]
