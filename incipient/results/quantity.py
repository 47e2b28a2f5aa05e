"""One number of a run's outcome, described once: read alike by history, result.json, text, page and tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

LOW, HIGH = "_low", "_high"  # of the columns that hold the ends of a quantity's error bar
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class OutputQuantity:
    """A number, or a vector of three, of a run's outcome."""

    key: str  # where result.json has it, such as "coefficients.drag"
    words: str  # its name for a reader
    unit: str = ""  # in units of the scene, such as "velocity"; empty: it has none
    column: str = ""  # its name in history.csv and in tables of sweeps; empty: it is in neither
    error: str = ""  # where result.json has its absolute error; empty: there is none
    # Low and high end of its error bar by result.json as plain data, where these are not value -+ error
    ends: Callable[[Mapping[str, Any]], tuple[float, float] | None] | None = None
    heading: str = ""  # of the table of the page in which it stands; empty: in none
    # Its value in a run, which result.json then has under the key; None: it is part of something else there
    measure: Callable[[Any], Any] | None = None
    at_steps: bool = False  # whether it is measured after each step for history.csv
    in_text: bool = False  # whether a line of the text says it

    @property
    def label(self) -> str:
        """Words and unit."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    def value(self, stored: Mapping[str, Any]) -> Any:
        """The value in result.json as plain data; None where there is none."""
        return at(stored, self.key)

    def bar(self, stored: Mapping[str, Any]) -> tuple[float, float] | None:
        """The ends of a number's error bar; None where they are not known."""
        if self.ends is not None:
            return self.ends(stored)
        value, error = self.value(stored), at(stored, self.error) if self.error else None
        return None if value is None or error is None else (value - error, value + error)

    def columns(self, stored: Mapping[str, Any]) -> dict[str, Any]:
        """Columns of a sweep's table; of a vector those of its components that are not zero."""
        value = self.value(stored)
        if value is None or not self.column:
            return {}
        if isinstance(value, str) or not hasattr(value, "__len__"):
            return {self.column: value} | _with_ends(self.column, self.bar(stored))
        errors = at(stored, self.error) if self.error else None
        found: dict[str, Any] = {}
        for place, axis in enumerate(AXES):
            name, one = f"{self.column}_{axis}", value[place]
            if one:
                ends = None if errors is None else (one - errors[place], one + errors[place])
                found |= {name: one} | _with_ends(name, ends)
        return found

    def line(self, stored: Mapping[str, Any]) -> str:
        """What the text says of a number that is there."""
        value, bar = self.value(stored), self.bar(stored)
        within = "" if bar is None else f", between {bar[0]:.6g} and {bar[1]:.6g}"
        return f"{self.label:<20}{value:.6g}{within}"


def at(stored: Any, key: str) -> Any:
    """The value at a key such as ``fluid.reynolds`` of plain data, rows of a list by number; None without one."""
    for part in key.split("."):
        if isinstance(stored, Mapping):
            stored = stored.get(part)
        else:
            stored = stored[int(part)] if part.isdigit() and stored is not None else None
    return stored


def _with_ends(name: str, ends: tuple[float, float] | None) -> dict[str, float]:
    return {} if ends is None else {name + LOW: ends[0], name + HIGH: ends[1]}
