"""Quantities of results: the single description used by files, terminal, pages and sweeps; places and paths as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LOW, HIGH = "_low", "_high"  # suffixes of the columns with the ends of an error bar
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class OutputQuantity:
    """A number, or a vector (3,), of a result: its label, unit, error bar and positions in files and on pages."""

    key: str  # its key in the JSON file, such as "coefficients.drag"
    words: str  # its label
    unit: str = ""  # in units of the scene, such as "velocity"; empty: dimensionless
    column: str = ""  # in history.csv and in tables of sweeps; empty: none
    error: str = ""  # key of its absolute error in the JSON file; empty: none
    # Ends of its error bar from the JSON file's plain data; None: value -+ error
    ends: Callable[[Mapping[str, Any]], tuple[float, float] | None] | None = None
    heading: str = ""  # of its table on the page; empty: none
    # Its value in a run, stored under the key; None: stored as part of another value
    measure: Callable[[Any], Any] | None = None
    # Its value from the rest of result.json, stored under the key; None: not derived
    derive: Callable[[Mapping[str, Any]], Any] | None = None
    at_steps: bool = False  # whether history.csv contains it
    line: str = ""  # of the terminal output; empty: none
    short: str | None = None  # its label on that line; None: its words
    detail: bool = False  # whether the terminal shows it only with details
    unlike: str = ""  # key of another value; shown only if both differ
    unbounded: bool = False  # whether null means infinity

    @property
    def label(self) -> str:
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    def value(self, stored: Mapping[str, Any]) -> Any:
        value = at(stored, self.key)
        if value is not None or not self.unbounded:
            return value
        within, _, _ = self.key.rpartition(".")
        return math.inf if not within or at(stored, within) is not None else None

    def shown(self, stored: Mapping[str, Any]) -> Any:
        """The value for display; None if absent, or equal to that at `unlike`."""
        value = self.value(stored)
        if self.unlike and np.array_equal(value, at(stored, self.unlike)):
            return None
        return value

    def bar(self, stored: Mapping[str, Any]) -> tuple[float, float] | None:
        if self.ends is not None:
            return self.ends(stored)
        value, error = self.value(stored), at(stored, self.error) if self.error else None
        if value is None or error is None:
            return None
        error = np.asarray(error, dtype=float)  # None is unknown
        return value - error, value + error

    def columns(self, stored: Mapping[str, Any]) -> dict[str, Any]:
        """The value and the ends of its error bar, of a vector those of each component that is not zero."""
        value = self.value(stored)
        if not self.column or value is None or value == "":
            return {}
        ends = (value, *(self.bar(stored) or ()))
        parts: dict[str, Sequence[Any]] = {"": ends}
        if np.ndim(value):
            axes = [(k, axis) for k, axis in enumerate(AXES[: len(value)]) if value[k]]
            parts = {f"_{axis}": [end[k] for end in ends] for k, axis in axes}
        return {
            f"{self.column}{axis}{suffix}": number
            for axis, numbers in parts.items()
            for suffix, number in zip(("", LOW, HIGH), numbers, strict=False)
        }

    def text(self, stored: Mapping[str, Any]) -> str:
        gdim, bar, within = gdim_of(stored), self.bar(stored), ""
        if bar is not None:
            error = 0.5 * np.subtract(bar[1], bar[0])
            within = " (error not known)"
            if np.isfinite(error).all():
                within = f" +- {words_of(error, self.unit, gdim, '.1e')}"
        name = self.label if self.short is None else self.short
        return f"{name} {words_of(self.value(stored), self.unit, gdim)}{within}".lstrip()


def screen_lines(
    quantities: Iterable[OutputQuantity], stored: Mapping[str, Any], details: bool = False
) -> list[str]:
    """Lines of the terminal output with these quantities."""
    parts: dict[str, list[str]] = {}
    for quantity in quantities:
        wanted = quantity.line and (details or not quantity.detail)
        if wanted and quantity.shown(stored) is not None:
            parts.setdefault(quantity.line, []).append(quantity.text(stored))
    return [row for line, texts in parts.items() for row in labelled(line, "   ".join(texts))]


def labelled(label: str, *lines: str) -> list[str]:
    """Lines of the terminal output, the first with a label."""
    return [f"{label if row == 0 else '':<20}{line}" for row, line in enumerate(lines)]


def at(stored: Any, key: str) -> Any:
    """Value at a key such as ``fluid.reynolds`` of plain data, list items by index; or None."""
    for part in key.split("."):
        if isinstance(stored, dict):
            stored = stored.get(part)
        elif stored is None:
            return None
        else:
            stored = stored[int(part)] if part.isdigit() else None
    return stored


def ends_at(key: str, stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """Ends of an error bar at a key, a pair or a section with low and high; null is infinite."""
    ends = at(stored, key)
    if ends is None:
        return None
    low, high = (ends["low"], ends["high"]) if isinstance(ends, dict) else ends
    return math.inf if low is None else low, math.inf if high is None else high


def put(stored: dict[str, Any], key: str, value: Any) -> None:
    """Store a value at a key such as ``force.pressure`` of plain data if the section exists."""
    section, _, name = key.rpartition(".")
    within = at(stored, section) if section else stored
    if within is not None:
        within[name] = value


def gdim_of(stored: Mapping[str, Any]) -> int:
    """Dimension of the scene of a result."""
    return 2 if at(stored, "scene.domain.width") is None else 3


def words_of(value: Any, unit: str, gdim: int, digits: str = ".6g") -> str:
    """A word, number or vector as text; in 2-D (x, y), of a torque its third component."""
    if isinstance(value, str):
        return value
    if np.ndim(value) and unit == "length" and digits == ".6g":
        return f"({', '.join(place_words(float(part), 6) for part in value)})"
    shown = components(value, gdim == 2, unit) if np.ndim(value) else float(value)
    if isinstance(shown, float):
        return format(shown, digits)
    return f"({', '.join(format(part, digits) for part in shown)})"


def components(vector: Any, planar: bool, unit: str = "") -> Any:
    """The displayed components of a vector, in 2-D the first two; of a torque in 2-D the third, a number."""
    if planar and unit == "torque":
        return float(vector[2])
    return tuple(float(part) for part in (vector[:2] if planar else vector))


# -- in words ---------------------------------------------------------------------------------------


def trajectory_sentence(trajectory: dict[str, Any]) -> str:
    """Final position of a grain and its history, in sentences."""
    ended, course = trajectory["ended"], trajectory.get("on_bed")
    place = ", ".join(place_words(x, 4) for x in trajectory["place"])
    met = f", where it has met the {ended['nearest']}" if ended["by"] == "contact" else ""
    does = "moves" if course is None else course_words(course)
    return f"The grain {does}; at t = {ended['time']:.4g} it is at ({place}){met}."


def at_the_end(verdict: Mapping[str, Any]) -> list[str]:
    """That the verdict on a held grain is of the end of its run in time, and when the flow would have moved it."""
    if "first_motion" not in verdict or verdict.get("rocking"):
        return []
    since = verdict["first_motion"]
    moved = "at no step" if since is None else f"from t = {since:.4g} on"
    return [f"that is at the end of the run: the flow would have moved it {moved}"]


def remarks(verdict: Mapping[str, Any], scene: Mapping[str, Any]) -> list[str]:
    """Remarks on the verdict of a run: its note or a remedy, and when it holds."""
    said = [verdict["note"]] if "note" in verdict else []
    if not said and verdict["safety_status"] in ("UNHELD", "HELD_BY_FLOW"):
        said = [without_rest((scene.get("body") or {}).get("settle"))]
    return said + at_the_end(verdict)


def without_rest(settled: Any) -> str:
    """What may give a grain a rest that moves without any flow; settled: `body.settle`."""
    if settled:
        return "it settled on a rougher bed or another slope: see contact.friction and bed.slope"
    return "with body.settle = true it first rolls and tips to a position of rest, if there is one"


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


def place_words(x: float, least: int = 5) -> str:
    """A coordinate as text, with at least two decimals, as map coordinates require."""
    return f"{x:.{max(least, len(f'{abs(x):.0f}') + 2)}g}"


def separation_words(spans: Sequence[Sequence[float]], errors: Any = None) -> str:
    """Intervals of reverse flow along the bed, the longest first and with its errors (2,)."""
    shown, most = list[str](), 4
    for start, end in spans[:most]:
        start = start if abs(start) > 1e-12 * (end - start) else 0.0  # round-off
        shown.append(f"x = {place_words(start)} to {place_words(end)}")
    if shown and errors is not None:
        shown[0] += " (within {:.1e} and {:.1e})".format(*errors)
    if len(spans) > most:
        shown.append(f"and {len(spans) - most} shorter intervals")
    return ", ".join(shown) or "none along the bed"
