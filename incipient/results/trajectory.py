"""Path of a moving grain and separation in words, and coordinates as text."""

from collections.abc import Sequence
from typing import Any

import numpy as np

MOST_SPANS = 4  # of reverse flow
ROUNDING = 1e-12  # of the length of an interval: a smaller start is shown as zero


def trajectory_sentence(trajectory: dict[str, Any]) -> str:
    """Final position of a grain and its history, in sentences."""
    ended, course = trajectory["ended"], trajectory.get("on_bed")
    place = ", ".join(place_words(one, 4) for one in trajectory["place"])
    met = f", where it has met the {ended['nearest']}" if ended["by"] == "contact" else ""
    does = "moves" if course is None else course_words(course)
    return f"The grain {does}; at t = {ended['time']:.4g} it is at ({place}){met}."


def course_words(course: dict[str, Any]) -> str:
    """Motion of a grain on its bed: its history and final state."""
    if course["first_motion"] is None:
        return "has stayed at rest"
    left = (
        ""
        if course["left_pocket"] is None
        else f", left its pocket at t = {course['left_pocket']:.4g}"
    )
    first, within = course["first_motion"], course.get("first_step")
    when = (
        f"at t = {first:.4g}"
        if within is None
        else f"between t = {first:.4g} and {first + within:.4g}"
    )
    return f"moved first {when}{left} (mode at the end: {course['mode']})"


def number_words(x: Any) -> str:
    """A number or vector as text."""
    return f"({', '.join(f'{one:.6g}' for one in x)})" if np.ndim(x) else f"{x:.6g}"


def place_words(x: float, least: int = 5) -> str:
    """A coordinate as text, with at least two decimals, as map coordinates require."""
    return f"{x:.{max(least, len(f'{abs(x):.0f}') + 2)}g}"


def separation_words(spans: Sequence[Sequence[float]], errors: Any = None) -> str:
    """Intervals of reverse flow along the bed, the longest first and with its errors (2,)."""
    ordered = sorted(spans, key=lambda span: span[0] - span[1])
    shown = []
    for start, end in ordered[:MOST_SPANS]:
        start = start if abs(start) > ROUNDING * (end - start) else 0.0
        shown.append(f"x = {place_words(start)} to {place_words(end)}")
    if shown and errors is not None:
        shown[0] += " (within {:.1e} and {:.1e})".format(*errors)
    if len(ordered) > MOST_SPANS:
        shown.append(f"and {len(ordered) - MOST_SPANS} shorter intervals")
    return ", ".join(shown) or "none along the bed"
