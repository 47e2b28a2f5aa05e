"""Results of 42 command lines, and how they compare with stored ones.

    python tests/regression/baseline.py store FILE [NAME ...]     run cases and store their quantities
    python tests/regression/baseline.py coarser FILE [NAME ...]   the same on cells larger by the square root of two
    python tests/regression/baseline.py also FILE [NAME ...]      beside those stored, the same of this processor

`baseline.json` holds the quantities of commit 5ddcb931, the last one before the second edition, and under
`coarser` those on the coarser cells. Stored anew since, with the reason:

- grain_on_waves, leaving_pocket, threshold_pocket, threshold_half_discs, entrainment: the effective level of the
  bed is from a table, 5e-6 lower; forces change by 1e-5, of the released disc by 5e-4
- sand_in_turbulence, threshold_sand: forces change by 1.2e-5, on the same cells; the cause is not isolated
- pebble: settling with exact friction cones has its rest 7e-4 of a diameter away
- sphere_in_pocket, threshold_sphere: another mesh of its bed, 0.2% more unknowns; the safety factor changes by 1e-4
- turbulent_channel, sand_in_turbulence, large_grain, backward_facing_step: one wall treatment and one inflow of both
  models; u* of the channel changes by 0.7%, more than half of it the friction of the viscous sublayer in the blend at
  y+ = 50, loads of large_grain by 0.1% and 0.3%, of sand_in_turbulence by 0.02%, the step's reattachment by 0.01%
- sand_in_turbulence: u* on average along the walls changes by 8%, since the bed no longer has twice the weight of the
  grain (its mean over x by 0.4%); separation by 0.4%, since friction is read at corners of cells alone
- backward_facing_step: the flow separates at the face of the step, not at the edge of its corner eddy
- survey: percentiles are values of the sample
- settling_sphere, pebble: cells make room for curved facets, some of which stayed flat; across the settling sphere,
  where force and torque are zero, they fall from 2668 to 800 and from 47815 to 13590 (of 2.6e6)
- sphere_on_plane: bars are a quarter wider: half of what order 3 changes, before 0.35 of it
- sphere_on_plane, sphere_in_pocket, pebble, threshold_sphere: another preconditioner leaves less of the error; at a
  tolerance of 1e-9 the forces stored now change by 3e-7 of the drag at most, those before were 8e-5 to 5e-4 away
- settling_sphere: for the same reason by 2e-6; a tolerance of 1e-9 changes them by 8e-4
- sphere_on_plane, settling_sphere: again another preconditioner, of outflow and of relaxation near walls; lift changes
  by 6e-6 of the drag, a velocity by 2e-6
- threshold_half_discs: another coarse mesh of its gap, whose placements differ by 1e-10; the factor changes by 9e-5,
  its bar is 3e-3
- grain_on_bed, cylinder: other gaps and domains are on the run's own moved mesh, sides 2 and 4 times as far; corrected
  forces change by 0.14% and 0.03%. Sides 20 times as far, on a mesh of their own, change the force on the grain by
  -0.0147; its correction is now -0.0155 +- 0.0015, before -0.0132 +- 0.0016
- sphere_on_plane: the interaction of corrections counts three times; its bar is 0.3% wider
- leaving_pocket: Broyden's update is no longer skipped in contact; forces change by 1e-5, velocities by 2e-6
- grain_on_bed: nearby flows reuse one another's factors; its bar changes by 1e-5, to 0.00272947, which both ways have
  at a tolerance of 1e-11, for 0.00272944 at that of before, 1e-5
- entrainment: without the load of the flow's acceleration; strengths change by 0.7%, 0.5%, 0.4% and 0.02%, their bars
  are 25%, 13%, 6% and 6%
- large_grain: Jacobians of turbulent flow serve two steps; lift changes by 1e-6, and at a tolerance of 1e-8 by 1.5e-7
- vortex_street: its impulsive start has two steps of first order; forces change by 1.4e-6, 1e-5 of the drag
- large_grain: corrections that turn back are relaxed; lift changes by 1.1e-6 and is 1.2e-6 from that at a tolerance of
  1e-8, the default tolerance being 1e-4
- sphere_on_plane, film_over_bump: steady flow begins with the base flow. Lift of the sphere, exactly zero, falls from
  2.3e-3 to 6e-6, drag changes by 4e-5; with order 2 solved to 1e-10 the loads of before fall to within 5e-6, lift to
  7e-4. Elevations change by 1.3e-6 of the depth, at a tolerance of 1e-10 by less than 1e-10

A result on the same mesh (as many cells and unknowns) must agree to
`SAME_MESH`, verdicts exactly. A result on another mesh must agree within the discretisation error of the stored one,
by the grid convergence index of two meshes (Roache 1994, J. Fluids Eng. 116, 405: a safety factor of 3; with a
refinement ratio of sqrt(2) and second order its denominator is one).

gmsh rounds otherwise on another make of processor and may make another mesh of as many cells. Equal numbers of cells
mean the same mesh on the makes of `PROCESSORS`, or those that a case stored anew has. Where `also` has stored results
of a make's own, they are the reference. On other makes every mesh counts as another one.
"""

from __future__ import annotations

import csv
import json
import math
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
STORED = Path(__file__).with_name("baseline.json")
SAME_MESH = 1e-6
TWO_MESH_SAFETY = 3.0
CASE_TIMEOUT = 1200.0
PROCESSORS = ("GenuineIntel", "AuthenticAMD")

NO_BARS, COARSE = "numerics.error_bars=false", "numerics.mesh_size=2"


@dataclass(frozen=True)
class Case:
    """A command line of `incipient`, without its --out, and the part that it belongs to."""

    part: str
    command: tuple[str, ...]
    settings: tuple[str, ...] = ()

    def words(self, extra: Iterable[str] = ()) -> list[str]:
        """The words of the command with its settings, later ones winning."""
        return [*self.command, *(w for key in (*self.settings, *extra) for w in ("--set", key))]


def _run(part: str, name: str, *settings: str) -> tuple[str, Case]:
    return name, Case(part, ("run", f"scenes/{name}.toml"), settings)


WAVY = ("bed.kind=sinusoidal", "bed.amplitude=0.3", "bed.wavelength=3", "body.settle=true", NO_BARS)
HALF_DISCS = ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2", "bed.offset=1")
GRAIN, POCKET = "scenes/grain_on_bed.toml", "scenes/pocket_in_gusts.toml"
CASES: dict[str, Case] = dict(
    [
        _run("plane", "grain_on_bed"),
        _run("plane", "cavity", NO_BARS),
        _run("plane", "cylinder"),
        (
            "grain_on_slope",
            Case("plane", ("run", GRAIN), ("bed.kind=inclined", "bed.slope=4", NO_BARS)),
        ),
        ("grain_on_waves", Case("plane", ("run", GRAIN), WAVY)),
        *(_run("unsteady", f"pothole_{n}", "time.end=0.6", COARSE, NO_BARS) for n in (1, 2, 3)),
        _run("unsteady", "pothole_4", "time.end=0.5", COARSE, NO_BARS),
        _run("unsteady", "settling", "time.end=4", NO_BARS),
        _run("unsteady", "shear_orbit", "time.end=3", NO_BARS),
        _run("unsteady", "leaving_pocket", "time.end=2", NO_BARS),
        _run("unsteady", "vortex_street", "time.end=1", NO_BARS),
        _run("unsteady", "pulsating", "time.end=1", NO_BARS),
        _run("surface", "standing_wave", "time.end=2", NO_BARS),
        _run("surface", "sloshing", "time.end=3", NO_BARS),
        _run("surface", "grain_under_waves", "time.end=1", NO_BARS),
        _run("surface", "floating_body", "time.end=1", NO_BARS),
        _run("surface", "grain_in_channel", "time.end=5", NO_BARS),
        _run("surface", "film_over_bump", "time.end=1.5", NO_BARS),
        _run("space", "sphere_on_plane"),
        _run("space", "sphere_in_pocket", NO_BARS),
        _run("space", "bead_on_substrate", NO_BARS),
        _run("space", "pebble", NO_BARS),
        _run("space", "settling_sphere", "time.end=0.2", NO_BARS),
        _run("space", "cylinder_in_space", NO_BARS),
        _run("space", "sphere_leaving_pocket", "time.end=0.6", NO_BARS),
        _run("turbulence", "turbulent_channel", NO_BARS),
        _run("turbulence", "large_grain", NO_BARS),
        _run("turbulence", "sand_in_turbulence", NO_BARS),
        _run("turbulence", "stone_in_turbulence", NO_BARS),
        _run("turbulence", "backward_facing_step", NO_BARS),
        ("threshold_pocket", Case("threshold", ("threshold", POCKET), (NO_BARS,))),
        ("threshold_half_discs", Case("threshold", ("threshold", GRAIN), HALF_DISCS)),
        (
            "threshold_sphere",
            Case("threshold", ("threshold", "scenes/sphere_in_pocket.toml"), (NO_BARS,)),
        ),
        (
            "threshold_sand",
            Case("threshold", ("threshold", "scenes/sand_in_turbulence.toml"), (NO_BARS,)),
        ),
        ("entrainment", Case("threshold", ("entrainment", POCKET), (NO_BARS,))),
        ("judge_block", Case("judge", ("judge", "cases/block_on_incline.toml"))),
        ("judge_disc", Case("judge", ("judge", "cases/disc_in_pocket.toml"))),
        ("judge_sphere", Case("judge", ("judge", "cases/sphere_on_three_spheres.toml"))),
        ("judge_batch", Case("judge", ("judge", "--batch", "cases/batch.csv"))),
        ("survey", Case("judge", ("survey", "beds/random_spheres.toml"))),
    ]
)


def run(name: str, extra: Iterable[str] = ()) -> dict[str, Any]:
    """Run a case as a process of its own; return its quantities, labels and mesh (see `measured`)."""
    case = CASES[name]
    with tempfile.TemporaryDirectory() as folder:
        writes = case.command[0] != "judge" or "--batch" in case.command
        out = ["--out", str(Path(folder) / "out")] if writes else []
        command = [sys.executable, "-m", "incipient", *case.words(extra), *out]
        done = subprocess.run(
            command, cwd=ROOT / "demos", capture_output=True, text=True, timeout=CASE_TIMEOUT
        )
        return measured(done.returncode, *_read(Path(folder)), done.stdout)


def _read(folder: Path) -> tuple[dict[str, Any], dict[str, list[dict[str, str]]]]:
    results = {path.name: json.loads(path.read_text()) for path in folder.rglob("*.json")}
    tables = {path.name: list(csv.DictReader(path.open())) for path in folder.rglob("*.csv")}
    return results, tables


def measured(
    code: int,
    results: Mapping[str, Any],
    tables: Mapping[str, list[dict[str, str]]],
    screen: str,
) -> dict[str, Any]:
    """What is compared: `values` (vectors of numbers by name), `labels` (verdicts, modes, exit code), `mesh`."""
    values: dict[str, list[float]] = {}
    labels: dict[str, Any] = {"exit code": code}
    mesh: list[int | None] = []
    for name in ("result.json", "threshold.json", "entrainment.json", "survey.json"):
        if name in results:
            values |= {key: vector for key, vector in _values(results[name]) if vector}
            labels |= dict(_labels(results[name]))
            size = results[name].get("cost") or {}
            mesh = [size.get("cells"), size.get("unknowns")]
    if rows := tables.get("history.csv"):
        values |= dict(_last_row(rows[-1]))
    for row in tables.get("verdicts.csv", []):
        labels[f"row {row['row']}"] = row["mode"]
        if row["safety_factor"]:
            values[f"safety factor of row {row['row']}"] = [float(row["safety_factor"])]
    if not results:
        labels["moves"] = "The grain begins to move" in screen
        values["safety factor"] = [
            float(number) for number in re.findall(r"safety factor ([\d.]+)", screen)
        ]
    return {"values": values, "labels": labels, "mesh": mesh}


# Quantities of the JSON files by path; the names beside them stay when a path changes.
PATHS = {
    "force": "force.flow",
    "torque": "torque.flow",
    "computed force": "force.computed",
    "computed torque": "torque.computed",
    "place": "grain.computed_centre",
    "safety factor": "verdict.safety_factor",
    "bar of the force": "error_bars.force",
    "bar of the torque": "error_bars.torque",
    "elevations": "surface.elevations",
    "shear velocity": "turbulence.shear_velocity",
    "separation": "turbulence.separated",
    "critical factor": "factor",
    "critical Shields number": "shields",
    "critical Reynolds number": "reynolds",
    "surveyed": "surveyed",
    "free grains": "free",
}
LABELS = {
    "moves": "verdict.moves",
    "mode": "verdict.mode",
    "mode by the paper": "verdict.judges.criteria.mode",
    "status": "status",
    "critical mode": "mode",
}


def _at(stored: Any, path: str) -> Any:
    for key in path.split("."):
        stored = stored.get(key) if isinstance(stored, dict) else None
    return stored


def _values(stored: dict[str, Any]) -> Iterator[tuple[str, list[float]]]:
    for name, path in PATHS.items():
        yield name, _numbers(_at(stored, path))
    for name, centreline in (stored.get("centrelines") or {}).items():
        yield name, _numbers([centreline["value"], centreline["position"]])
    for quantile in stored.get("quantiles") or []:
        yield f"strength at {quantile['probability']}", _numbers(quantile["strength"])
    for key in ("pivots", "constant_drag"):
        for entry in stored.get(key) or []:
            number = entry.get("pivot", entry.get("shields"))
            yield f"{key} at {entry['percentile']}%", _numbers(number)


def _labels(stored: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, path in LABELS.items():
        if isinstance(label := _at(stored, path), str | bool):
            yield name, label


def _numbers(stored: Any) -> list[float]:
    entries = stored if isinstance(stored, list) else [stored]
    return [float(e) for e in entries if isinstance(e, int | float) and math.isfinite(e)]


LAST_ROW = re.compile(
    r"(x|y|z)|(velocity|force|elevation)_\w+|time|angle|spin\w*|torque\w*|energy_\w+"
)


def _last_row(row: Mapping[str, str]) -> Iterator[tuple[str, list[float]]]:
    groups: dict[str, list[float]] = {}
    for column, entry in row.items():
        if entry and (match := LAST_ROW.fullmatch(column)):
            group = "place" if match[1] else match[2] or column.partition("_")[0]
            groups.setdefault(group, []).append(float(entry))
    yield from ((f"{group} at the end", numbers) for group, numbers in groups.items())


def processor() -> str:
    """The make of this machine's processor."""
    cpuinfo = Path("/proc/cpuinfo")
    result = re.search(r"vendor_id\s*: (\S+)", cpuinfo.read_text() if cpuinfo.exists() else "")
    return result[1] if result else platform.machine()


def differences(stored: Mapping[str, Any], now: Mapping[str, Any], make: str) -> list[str]:
    """What differs by more than it may on a make of processor, a line each; see the head of this file."""
    own = stored.get("also", {}).get(make)
    meshed = stored.get("coarser") is not None
    known = own is not None or not meshed or make in stored.get("processors", PROCESSORS)
    if not known:
        print(f"compared as on another mesh: nothing is stored of a processor of {make}")
    stored = stored | (own or {})
    # An entrainment curve does not say on which mesh its threshold was computed.
    unknown = own is None and stored["mesh"] == [None, None] and meshed
    same_mesh = known and stored["mesh"] == now["mesh"] and not unknown
    lines = [
        f"{name}: {now['labels'].get(name)!r}, stored {label!r}"
        for name, label in stored["labels"].items()
        if now["labels"].get(name) != label
    ]
    if stored["mesh"] != now["mesh"]:
        print(f"another mesh: {now['mesh']}, stored {stored['mesh']}")
    for name, reference in stored["values"].items():
        numbers, allowed = now["values"].get(name), _allowed(name, stored, same_mesh)
        if numbers is None or len(numbers) != len(reference):
            lines.append(f"{name}: {numbers}, stored {reference}")
        elif allowed is None:
            lines.append(f"{name}: on another mesh, and no coarser one to compare with")
        elif (difference := _distance(numbers, reference)) > allowed:
            lines.append(
                f"{name}: {numbers} differs by {difference:.3g} (allowed {allowed:.3g}) from {reference}"
            )
    return lines


def _allowed(name: str, stored: Mapping[str, Any], same_mesh: bool) -> float | None:
    reference = stored["values"][name]
    if same_mesh:
        return SAME_MESH * max(_scale(name, stored), 1e-9)
    coarser = ((stored.get("coarser") or {}).get("values") or {}).get(name)
    if coarser is None or len(coarser) != len(reference):
        return None
    return TWO_MESH_SAFETY * _distance(coarser, reference) + SAME_MESH * _scale(name, stored)


def _scale(name: str, stored: Mapping[str, Any]) -> float:
    """The magnitude that a difference is relative to: the torque's at least the force's over a unit length."""
    scale = max(map(abs, stored["values"][name]))
    twin = name.replace("torque", "force").replace("spin", "velocity").replace("angle", "place")
    return max([scale, *map(abs, stored["values"].get(twin, []))])


def _distance(first: list[float], second: list[float]) -> float:
    return max((abs(a - b) for a, b in zip(first, second, strict=True)), default=0.0)


def _coarser_cells(name: str) -> list[str]:
    from incipient import load

    case = CASES[name]
    pairs = (setting.partition("=") for setting in case.settings)
    sizes = [float(value) for key, _, value in pairs if key == "numerics.mesh_size"]
    size = sizes[-1] if sizes else load(ROOT / "demos" / case.command[1]).numerics.mesh_size
    return [f"numerics.mesh_size={size * math.sqrt(2):.6g}"]


def main() -> None:
    """Store quantities of cases as those of a reference, or as those on coarser cells."""
    kind, file, *names = sys.argv[1:]
    path = Path(file)
    stored = json.loads(path.read_text()) if path.exists() else {}
    for name in names or CASES:
        if kind == "store":
            coarser = (stored.get(name) or {}).get("coarser")
            stored[name] = run(name) | {"coarser": coarser, "processors": [processor()]}
        elif kind == "also":
            stored[name].setdefault("also", {})[processor()] = run(name)
        elif CASES[name].part != "judge":
            stored.setdefault(name, {})["coarser"] = run(name, _coarser_cells(name))
        path.write_text(json.dumps(stored, indent=1) + "\n")
        print(name, flush=True)


if __name__ == "__main__":
    main()
