"""What a certified error of the force costs: runs to 3%, 1% and 0.3%, with corrected loads and with loads as computed.

The error of a row is that of the error bars, all terms, over the force: what the program answers for, not what
it knows of the truth (`benchmarks/calibration.py` compares the bars with that).

Cost:    an hour and a half.
Run:     python benchmarks/certified.py [a part of the scenes' names]
Results: benchmarks/certified.json and, from all that it has, the table "certified"
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from callers import command
from measure import measure
from tables import ROOT, publish, read_json, table, write_json

STORED = ROOT / "benchmarks/certified.json"
SCENES, MINE = ROOT / "demos" / "scenes", ROOT / "benchmarks" / "scenes"
ACCURACIES = (None, 0.03, 0.01, 0.003)
LONGEST = 400  # seconds of processor time that a run may take
INERTIA = {"fluid.inertia": True, "fluid.reynolds": 20}
CASES: dict[str, tuple[Path, dict[str, Any]]] = {
    "grain on a bed": (SCENES / "grain_on_bed.toml", {}),
    "disc in a pocket": (MINE / "pocket_of_half_discs.toml", {}),
    "sphere on a plane, creeping": (SCENES / "sphere_on_plane.toml", {}),
    "sphere on a plane, Re 20": (SCENES / "sphere_on_plane.toml", INERTIA),
    "sphere on a plane, G d²/ν = 200": (MINE / "sphere_in_shear.toml", {}),
    "sphere in a pocket": (SCENES / "sphere_in_pocket.toml", {}),
    "free sphere, Re 100": (MINE / "free_sphere.toml", {}),
}
HEADS = ("scene", "default: error", "s", "3%: s", "1%: s", "0.3%: s")


@dataclass(frozen=True)
class Row:
    """One run: the error asked for (None: the default run) and certified, processor time in s, peak in MiB."""

    name: str
    asked: float | None
    corrected: bool
    error: float
    seconds: float
    mib: float
    unknowns: int
    why: str = ""

    @property
    def reached(self) -> bool:
        """Whether the error is as small as it was to be."""
        return self.error <= (self.asked or math.inf)

    def seconds_of_success(self) -> str:
        """Processor time in s; a dash where the error was not reached."""
        return f"{self.seconds:.0f}" if self.reached else "-"


def row_of(name: str, asked: float | None, corrected: bool) -> Row:
    """Run a scene to an accuracy in a process of its own and read the error that it certifies."""
    path, own = CASES[name]
    keys = own | {
        "numerics.error_bars": True,
        "output.fields": False,
        "numerics.correction": corrected,
    }
    if asked is not None:
        keys |= {"numerics.accuracy": asked, "numerics.accuracy_includes": "all"}
        keys["numerics.budget_seconds"] = LONGEST
    with tempfile.TemporaryDirectory() as directory:
        usage = measure(command("run", path, keys, "--out", directory))
        result = read_json(Path(directory) / "result.json")
    error, unknowns, why = math.inf, 0, ""
    if result is None:
        why = usage.complaint
    elif result["error_bars"] is None:
        why = result["without_error_bars"] or result["error"]
    else:
        error = math.hypot(*result["error_bars"]["force"]) / math.hypot(*result["force"]["flow"])
    if result:
        unknowns = result["cost"]["unknowns"]
    return Row(name, asked, corrected, error, usage.cpu, usage.peak_mib, unknowns, why)


def text_of(rows: dict[tuple[str, float | None, bool], Row]) -> str:
    """The table of all scenes, in brackets with loads as computed, and what they come to."""
    lines, ratios = [], []
    for name in CASES:
        runs = [[rows.get((name, asked, way)) for way in (True, False)] for asked in ACCURACIES]
        if runs[0][0] is None:
            continue
        errors = [f"{100 * row.error:.2g}%" if row else "-" for row in runs[0]]
        times = [[row.seconds_of_success() if row else "-" for row in pair] for pair in runs]
        cells = [f"{corrected} ({computed})" for corrected, computed in (errors, *times)]
        lines.append([name, *cells])
        for corrected, computed in runs[1:]:
            if corrected and corrected.reached:
                ratios.append(
                    corrected.seconds / computed.seconds if computed and computed.reached else 0.0
                )
    summary = (
        f"Corrected loads reach {len(ratios)} of {3 * len(CASES)} accuracies; {ratios.count(0.0)} of these are not "
        "reached by loads as computed. "
        f"The median ratio of the times is {median(ratios or [0.0]):.2f}, with 0 for the latter."
    )
    return f"{table(HEADS, lines)}\n\n{summary}" if ratios else table(HEADS, lines)


def main(wanted: list[str]) -> None:
    """Run the scenes whose names have one of the words wanted, or all, and renew the page after each."""
    known = [Row(**row) for row in read_json(STORED, [])]
    rows = {(row.name, row.asked, row.corrected): row for row in known}
    for name in CASES:
        if wanted and not any(word in name for word in wanted):
            continue
        for corrected in (True, False):
            for asked in ACCURACIES:
                row = row_of(name, asked, corrected)
                print(row, flush=True)
                rows[name, asked, corrected] = row
                write_json(STORED, [asdict(each) for each in rows.values()])
                if not row.reached:
                    break  # nor would a smaller one be
    publish("certified", text_of(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
