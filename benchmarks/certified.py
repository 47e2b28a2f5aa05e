"""What a certified error of the force costs: runs to 3%, 1% and 0.3%, with corrected loads and with loads as computed.

The error of a row is that of the error bars, all terms, over the force: what the program answers for, not what
it knows of the truth (`benchmarks/calibration.py` compares the bars with that).

Cost:    an hour and a half.
Run:     python benchmarks/certified.py [a part of the scenes' names]
Results: benchmarks/certified.json and, from all that it has, the table "certified"
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import measure
from tables import publish

ROOT = Path(__file__).resolve().parents[1]
STORED = Path(__file__).parent / "certified.json"
SCENES, MINE = ROOT / "demos" / "scenes", ROOT / "benchmarks" / "scenes"
ACCURACIES = (None, 0.03, 0.01, 0.003)
LONGEST = 400  # seconds of processor time that a run may take
INERTIA = ("fluid.inertia=true", "fluid.reynolds=20")
CASES: dict[str, tuple[Path, tuple[str, ...]]] = {
    "grain on a bed": (SCENES / "grain_on_bed.toml", ()),
    "disc in a pocket": (MINE / "pocket_of_half_discs.toml", ()),
    "sphere on a plane, creeping": (SCENES / "sphere_on_plane.toml", ()),
    "sphere on a plane, Re 20": (SCENES / "sphere_on_plane.toml", INERTIA),
    "sphere on a plane, G d²/ν = 200": (MINE / "sphere_in_shear.toml", ()),
    "sphere in a pocket": (SCENES / "sphere_in_pocket.toml", ()),
    "free sphere, Re 100": (MINE / "free_sphere.toml", ()),
}
HEAD = """| scene | default: error | s | 3%: s | 1%: s | 0.3%: s |
| --- | --: | --: | --: | --: | --: |"""


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
    path, given = CASES[name]
    settings = [*given, "numerics.error_bars=true", "output.fields=false"]
    if not corrected:
        settings.append("numerics.correction=false")
    if asked is not None:
        settings += [f"numerics.accuracy={asked}", 'numerics.accuracy_includes="all"']
        settings.append(f"numerics.budget_seconds={LONGEST}")
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "out"
        options = [part for setting in settings for part in ("--set", setting)]
        usage = measure.measure(["incipient", "run", str(path), "--out", str(out), *options])
        if not (out / "result.json").is_file():
            why = (usage.errors.strip().splitlines() or [f"exit code {usage.exit_code}"])[-1][:200]
            return Row(name, asked, corrected, math.inf, usage.cpu, usage.peak_mib, 0, why)
        result = json.loads((out / "result.json").read_text())
    bars, unknowns = result["error_bars"], result["cost"]["unknowns"]
    if bars is None:
        why = result["without_error_bars"] or result["error"]
        return Row(name, asked, corrected, math.inf, usage.cpu, usage.peak_mib, unknowns, why)
    error = math.hypot(*bars["force"]) / math.hypot(*result["force"]["flow"])
    return Row(name, asked, corrected, error, usage.cpu, usage.peak_mib, unknowns)


def table(rows: dict[tuple[str, float | None, bool], Row]) -> str:
    """The table of all scenes, in brackets with loads as computed, and what they come to."""
    lines, ratios = [HEAD], []
    for name in CASES:
        runs = [[rows.get((name, asked, way)) for way in (True, False)] for asked in ACCURACIES]
        if (own := runs[0][0]) is None:
            continue
        cells = [_errors(runs[0]), _seconds(runs[0]), *map(_seconds, runs[1:])]
        lines.append(f"| {' | '.join((own.name, *cells))} |")
        for corrected, computed in runs[1:]:
            if corrected and corrected.reached:
                reached = computed and computed.reached
                ratios.append(corrected.seconds / computed.seconds if reached else 0.0)
    if ratios:
        lines += [
            "",
            f"Corrected loads reach {len(ratios)} of {3 * len(CASES)} accuracies; {ratios.count(0.0)} of these are not "
            "reached by loads as computed. "
            f"The median ratio of the times is {median(ratios):.2f}, with 0 for the latter.",
        ]
    return "\n".join(lines)


def _errors(pair: list[Row | None]) -> str:
    corrected, computed = (f"{100 * row.error:.2g}%" if row else "-" for row in pair)
    return f"{corrected} ({computed})"


def _seconds(pair: list[Row | None]) -> str:
    corrected, computed = (row.seconds_of_success() if row else "-" for row in pair)
    return f"{corrected} ({computed})"


def main(wanted: list[str]) -> None:
    """Run the scenes whose names have one of the words wanted, or all, and renew the page after each."""
    known = [Row(**one) for one in json.loads(STORED.read_text())] if STORED.is_file() else []
    rows = {(row.name, row.asked, row.corrected): row for row in known}
    for name in CASES:
        if wanted and not any(one in name for one in wanted):
            continue
        for corrected in (True, False):
            for asked in ACCURACIES:
                row = row_of(name, asked, corrected)
                print(row, flush=True)
                rows[name, asked, corrected] = row
                STORED.write_text(
                    json.dumps([asdict(one) for one in rows.values()], indent=1) + "\n"
                )
                if not row.reached:
                    break  # nor would a smaller one be
    publish("certified", table(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
