"""Path of a moving grain in sentences, and coordinates as text."""

from typing import Any

import numpy as np


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
