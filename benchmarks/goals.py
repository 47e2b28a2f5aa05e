"""What the program is asked to reach, and whether it does: the first table of the page and its last section."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import callers
from cases import cavity, contact, cylinder, free_body, vortex_street
from references import VORTEX_STREET
from tables import Row, cheapest, table


@dataclass(frozen=True)
class Goal:
    """A limit on time [s] and memory [MiB] for a piece of work, and the row that did it (None: not reached)."""

    work: str
    wall: float
    memory: float | None
    row: Row | None

    @property
    def reached(self) -> bool:
        """Whether work was done within the limits."""
        if self.row is None or "error" in self.row:
            return False
        return self.row["wall"] <= self.wall and (
            self.memory is None or self.row["peak_mib"] <= self.memory
        )

    def cells(self) -> list[str]:
        """Cells of the table."""
        limit = self.limit + (f", {self.memory:g} MiB" if self.memory else "")
        if self.row is None or "error" in self.row:
            return [self.work, limit, "-", "**no**"]
        found = f"{self.row['wall']:.2f} s, {self.row['peak_mib']:.0f} MiB"
        return [self.work, limit, found, "yes" if self.reached else "**no**"]

    @property
    def limit(self) -> str:
        """The limit on time in words."""
        return f"{self.wall:g} s"


@dataclass(frozen=True)
class Rate:
    """So many answers a second, and how many there were."""

    work: str
    least: float
    found: float

    @property
    def reached(self) -> bool:
        """Whether there were enough."""
        return self.found >= self.least

    def cells(self) -> list[str]:
        """Cells of the table."""
        return [
            self.work,
            self.limit,
            f"{self.found:.0f} a second",
            "yes" if self.reached else "**no**",
        ]

    @property
    def limit(self) -> str:
        """The limit in words."""
        return f"{self.least:g} a second"


@dataclass(frozen=True)
class Share:
    """A part of the wall time, and how large it may be and is."""

    work: str
    most: float
    found: float

    @property
    def reached(self) -> bool:
        """Whether it is small enough."""
        return self.found <= self.most

    def cells(self) -> list[str]:
        """Cells of the table."""
        return [
            self.work,
            self.limit,
            f"{100 * self.found:.0f}% of the time",
            "yes" if self.reached else "**no**",
        ]

    @property
    def limit(self) -> str:
        """The limit in words."""
        return f"{100 * self.most:g}% of the time"


def goals(measured: dict[str, Any]) -> list[Goal | Rate | Share]:
    """All goals whose case has been measured."""
    return list(_goals(measured))


def _goals(measured: dict[str, Any]) -> Iterator[Goal | Rate | Share]:
    own = callers.INCIPIENT
    if rows := measured.get("cylinder", {}).get("rows"):
        best = cheapest(rows, cylinder.reaches).get(own)
        yield Goal("DFG 2D-1 to 1e-6 in C_D, 1e-3 in C_L", 2.5, 400, best)
    if rows := measured.get("cavity", {}).get("rows"):
        best = cheapest(rows, lambda row: cavity.worst(row) <= cavity.TARGET).get(own)
        yield Goal("cavity, Re = 1000, from rest, extrema to 1e-4", 3.0, None, best)
    if rows := measured.get("steep_cavity", {}).get("rows"):
        best = cheapest(rows, lambda row: max(row["errors"].values()) <= 1e-3).get(own)
        yield Goal("cavity, Re = 4000, from rest, extrema to 1e-3", 15.0, None, best)
    if street := measured.get("vortex_street"):
        rows = [row for row in (street["periodic"], *street["refined"]) if "error" not in row]
        best = cheapest(rows, lambda row: vortex_street.worst(row) <= 5e-3).get(own)
        yield Goal("vortex street (DFG 2D-2) to 0.5% in C_D, C_L and St", 15.0, None, best)
    if runs := measured.get("grain", {}).get("runs"):
        yield Goal("grain on a bed, first run", 30.0, 1024, runs[0])
        yield Goal("grain on a bed, later runs", 6.0, 1024, runs[1])
    if row := free_body.fine(measured.get("free_body", {}).get("rows", [])):
        work = f"free body, {row['unknowns']} unknowns: body, interface and mesh motion"
        yield Share(work, free_body.GOAL, free_body.share(row))
    if rates := measured.get("contact", {}).get("rates"):
        for name, least in contact.GOALS.items():
            yield Rate(f"{contact.WORK[name]}, 4 contacts in space", least, rates[name])


def summary(measured: dict[str, Any]) -> str:
    """The goals as a table."""
    return table(
        ["work", "goal", "measured", "reached"], [goal.cells() for goal in goals(measured)]
    )


def shortcomings(measured: dict[str, Any]) -> list[str]:
    """What the numbers say against the program besides missed goals, in sentences."""
    return [*_slower(measured), *_outside(measured), *_memory(measured)]


def _slower(measured: dict[str, Any]) -> Iterator[str]:
    """Programs that reached the same accuracy in less time."""
    races = {
        "cylinder": ("DFG 2D-1", cylinder.reaches),
        "cavity": ("the cavity at Re = 1000", lambda row: cavity.worst(row) <= cavity.TARGET),
    }
    for name, (work, reaches) in races.items():
        best = cheapest(measured.get(name, {}).get("rows", []), reaches)
        ours = best.get(callers.INCIPIENT)
        for family, row in best.items():
            if ours and row["wall"] < ours["wall"]:
                ratio = ours["wall"] / row["wall"]
                yield f"{work}: {family} reaches the accuracy sooner; incipient takes {ratio:.2f} times as long."


def _outside(measured: dict[str, Any]) -> Iterator[str]:
    street = measured.get("vortex_street", {}).get("periodic", {})
    for name, (low, high) in VORTEX_STREET.items():
        value = street.get("found", {}).get(name)
        if value is not None and not low <= value <= high:
            yield f"DFG 2D-2: {name} {value:.4f} lies outside the published {low:g} to {high:g}."


def _memory(measured: dict[str, Any]) -> Iterator[str]:
    for row in measured.get("memory", {}).get("rows", []):
        off = row["announced"] / row["peak_mib"] - 1
        if abs(off) > 0.25:
            yield f"Memory announced for {row['name']} is off by {100 * off:+.0f}%."
