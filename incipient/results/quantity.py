"""The numbers of results, each described once: files, screen, page, SI values and tables of sweeps walk them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

LOW, HIGH = "_low", "_high"  # of the columns that hold the ends of a quantity's error bar
AXES = ("x", "y", "z")
STORED_NAMES = {"shear": "shear_velocity"}  # of fields, where results have others


@dataclass(frozen=True)
class OutputQuantity:
    """A number, or a vector of three, of a result: its label, unit, error bar and places.

    Vectors in units of force or torque have as many components as the scene; of a torque in 2-D it is the third.
    """

    key: str  # where the JSON file has it, such as "coefficients.drag"
    words: str  # its name for a reader
    unit: str = ""  # in units of the scene, such as "velocity"; empty: it has none
    column: str = ""  # its name in history.csv and in tables of sweeps; empty: it is in neither
    error: str = ""  # where the JSON file has its absolute error; empty: there is none
    # Low and high end of its error bar by the JSON file as plain data, where these are not value -+ error
    ends: Callable[[Mapping[str, Any]], tuple[float, float] | None] | None = None
    heading: str = ""  # of the table of the page in which it stands; empty: in none
    # Its value in a run, which result.json then has under the key; None: it is part of something else there
    measure: Callable[[Any], Any] | None = None
    # Its value by the rest of result.json as plain data, which has it under the key; None: it is not derived
    derive: Callable[[Mapping[str, Any]], Any] | None = None
    at_steps: bool = False  # whether it is measured after each step for history.csv
    line: str = ""  # of the screen on which it stands, beside others of that line; empty: on none
    short: str | None = None  # its name on that line; None: its words
    detail: bool = False  # whether the screen has it only if details are wanted
    unlike: str = ""  # key of another value; shown only where it differs from that
    unbounded: bool = False  # whether null stands for infinity

    @property
    def label(self) -> str:
        """Words and unit."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    @property
    def is_load(self) -> bool:
        """Whether it is a force or a torque."""
        return self.unit in ("force", "torque")

    def value(self, stored: Mapping[str, Any]) -> Any:
        """The value in plain data; None where there is none."""
        value = at(stored, self.key)
        if value is not None or not self.unbounded:
            return value
        within, _, _ = self.key.rpartition(".")
        return math.inf if not within or at(stored, within) is not None else None

    def shown(self, stored: Mapping[str, Any]) -> Any:
        """The value for a reader; None where there is none or where it says nothing new."""
        value = self.value(stored)
        if self.unlike and np.array_equal(value, at(stored, self.unlike)):
            return None
        return value

    def bar(self, stored: Mapping[str, Any]) -> tuple[float, float] | None:
        """The ends of a number's error bar; None where they are not known."""
        if self.ends is not None:
            return self.ends(stored)
        value, error = self.value(stored), at(stored, self.error) if self.error else None
        return None if value is None or error is None else (value - error, value + error)

    def columns(self, stored: Mapping[str, Any]) -> dict[str, Any]:
        """Columns of a sweep's table; of a vector those of its components that are not zero."""
        if not self.column or (value := self.value(stored)) in (None, ""):
            return {}
        if isinstance(value, str) or not hasattr(value, "__len__"):
            return {self.column: value} | _with_ends(self.column, self.bar(stored))
        errors = at(stored, self.error) if self.error else None
        found: dict[str, Any] = {}
        for place, axis in enumerate(AXES):
            name, part = f"{self.column}_{axis}", value[place]
            if part:
                ends = None if errors is None else (part - errors[place], part + errors[place])
                found |= {name: part} | _with_ends(name, ends)
        return found

    def text(self, stored: Mapping[str, Any]) -> str:
        """Name, value and error bar on a line of the screen."""
        value, bar = self.value(stored), None if self.is_load else self.bar(stored)
        shown = load_words(value, self.unit, gdim_of(stored)) if self.is_load else f"{value:.6g}"
        within = "" if bar is None else f" +- {0.5 * (bar[1] - bar[0]):.1e}"
        name = self.label if self.short is None else self.short
        return f"{name} {shown}{within}".lstrip()


def screen_lines(
    quantities: Iterable[OutputQuantity], stored: Mapping[str, Any], details: bool = False
) -> list[str]:
    """The lines of the screen that quantities stand on, in their order."""
    parts: dict[str, list[str]] = {}
    for quantity in quantities:
        wanted = quantity.line and (details or not quantity.detail)
        if wanted and quantity.shown(stored) is not None:
            parts.setdefault(quantity.line, []).append(quantity.text(stored))
    return [f"{line:<20}{'   '.join(texts)}" for line, texts in parts.items()]


def at(stored: Any, key: str) -> Any:
    """The value at a key such as ``fluid.reynolds`` of plain data, rows of a list by number; None without one."""
    for part in key.split("."):
        if isinstance(stored, dict):
            stored = stored.get(part)
        elif stored is None:
            return None
        else:
            stored = stored[int(part)] if part.isdigit() else None
    return stored


def put(stored: dict[str, Any], key: str, value: Any) -> None:
    """Store a value at a key such as ``force.pressure`` of plain data, unless that has no such section."""
    section, _, name = key.rpartition(".")
    within = at(stored, section) if section else stored
    if within is not None:
        within[name] = value


def gdim_of(stored: Mapping[str, Any]) -> int:
    """Dimension of the scene of a result."""
    return 2 if at(stored, "scene.domain.width") is None else 3


def load_words(vector: Any, unit: str, gdim: int, digits: str = ".6g") -> str:
    """A force or a torque (3,) for a reader: (x, y), in 3-D (x, y, z); of a torque in 2-D the third component."""
    if unit == "torque" and gdim == 2:
        return format(float(vector[2]), digits)
    return f"({', '.join(format(float(part), digits) for part in vector[:gdim])})"


def as_stored(value: Any) -> Any:
    """Data classes as dictionaries, under the names of results; an array without numbers is None."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value):
        parts = {field.name: getattr(value, field.name) for field in fields(value)}
        return {STORED_NAMES.get(name, name): as_stored(part) for name, part in parts.items()}
    if isinstance(value, dict):
        return {key: as_stored(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [as_stored(part) for part in value]
    return None if isinstance(value, np.ndarray) and not value.size else value


def _with_ends(name: str, ends: tuple[float, float] | None) -> dict[str, float]:
    return {} if ends is None else {name + LOW: ends[0], name + HIGH: ends[1]}
