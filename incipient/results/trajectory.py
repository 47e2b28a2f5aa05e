"""The path of a moving grain as text."""

from typing import Any

import numpy as np

from ..geometry.placement import Placement

ENDS = {
    "out-of-pocket": "out of its pocket",
    "at-rest": "at rest again",
    "in-pocket": "in its pocket after the gust",
}


def trajectory_lines(trajectory: dict[str, Any]) -> list[str]:
    """Position and velocity of a grain, and its history on the bed, in lines."""
    _, velocity, turned, spin = (number_words(x) for x in _motion_of(trajectory))
    at = ", ".join(place_words(one, 6) for one in trajectory["place"])
    unit = "rad" if "angle" in trajectory else "rad about x, y and z"
    iterations, ended = trajectory["interface_iterations"], trajectory["ended"]
    missing = ended["without_verdict"]
    return [
        f"grain at            ({at}), turned by {turned} {unit}; t = {ended['time']:.6g}, {_end(ended)}",
        f"velocity            {velocity}, spin {spin} rad per unit of time",
        *_on_bed(trajectory.get("on_bed")),
        f"interface           {iterations['mean']:.1f} iterations a step, {iterations['most']} at most; "
        f"{len(trajectory['remeshings'])} new meshes",
        *([f"verdict             none: {missing}"] if missing else []),
    ]


def trajectory_sentence(trajectory: dict[str, Any]) -> str:
    """Final position of a grain and its history, in sentences."""
    ended, course = trajectory["ended"], trajectory.get("on_bed")
    place = ", ".join(place_words(one, 4) for one in trajectory["place"])
    met = f", where it has met the {ended['nearest']}" if ended["by"] == "contact" else ""
    does = "moves" if course is None else course_words(course)
    return f"The grain {does}; at t = {ended['time']:.4g} it is at ({place}){met}."


def course_words(course: dict[str, Any]) -> str:
    """Motion of a grain on its bed: its history, and its state at the end."""
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


def _end(ended: dict[str, Any]) -> str:
    if ended["by"] == "contact":
        return f"met the {ended['nearest']}"
    return ENDS.get(ended["by"]) or f"{ended['clearance']:.3g} from the {ended['nearest']}"


def _on_bed(course: dict[str, Any] | None) -> list[str]:
    """Motion of a grain on its bed, as lines of text."""
    if course is None:
        return []
    works = ", ".join(f"{name} {work:.4g}" for name, work in course["works"].items())
    return [f"on its bed          {course_words(course)}", f"works               {works}"]


def _motion_of(trajectory: dict[str, Any]) -> tuple[Any, Any, Any, Any]:
    """Position, velocity, angle or shortest rotation vector, and spin at the end of a path."""
    place, turned = trajectory["place"], trajectory.get("angle")
    if turned is None:
        origin = (0.0, 0.0, 0.0)
        turned = Placement(origin, quaternion=tuple(trajectory["quaternion"])).turn_since(
            Placement(origin)
        )
    return place, trajectory["velocity"], turned, trajectory["spin"]
