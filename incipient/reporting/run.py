"""What a page says of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..effects import known
from ..output.ownership import DRAWN
from ..pictures.judged import Judged, judged, sentence
from ..pictures.record import parsed_json
from ..results.trajectory import trajectory_sentence
from .errors import certainty, of_errors
from .expense import of_adaptation, of_cost, of_omissions, of_plan, versions
from .page import Bounded, Cell, Erring, PagePart, PageSection, Picture, Rows, section, table, words
from .units import of_si
from .verdict import components, of_contacts, of_judges, statements, turning

CAPTIONS = {
    "verdict": "The verdict: forces on the grain and at its contacts",
    "flow": "Speed and streamlines",
    "pressure": "Pressure",
    "elevation": "The free surface from above",
    "vorticity": "Vorticity",
    "traction": "Traction of the fluid on the grain",
    "profiles": "Velocity on the centrelines",
    "trajectory": "Path of the grain",
    "walls": "y+ and friction along the walls",
    "mesh": "The mesh",
}
FORCES = (
    ("flow", "the flow, without buoyancy"),
    ("computed", "the same as computed, without corrections"),
    ("surface_integral", "the same as an integral over the surface, a check"),
    ("buoyancy", "buoyancy"),
    ("weight", "weight"),
    ("total", "in all"),
)


def part(record: Path) -> PagePart:
    """What a page says of the result.json of a run."""
    directory, stored = record.parent, parsed_json(record)
    planar = stored["scene"]["domain"].get("width") is None
    verdict = stored["verdict"]
    case = None if verdict is None else judged(verdict, record)
    told = () if case is None else (*of_contacts(case), *of_judges(verdict, case))
    found = [(directory / f"{name}.png", CAPTIONS[name]) for name in CAPTIONS if name in DRAWN]
    sections = (
        *section(
            "Pictures", *(Picture(path, caption) for path, caption in found if path.is_file())
        ),
        *_loads(stored, planar),
        *of_si(stored.get("si")),
        *_surface(stored),
        *_findings(stored),
        *told,
        *_path(stored),
        *of_errors(stored["error_bars"], planar),
        *of_plan(stored["plan"]),
        *of_omissions(stored["omitted"]),
        *of_adaptation(stored["adaptation"]),
        *of_cost(stored["cost"]),
    )
    return PagePart(
        kind="Run",
        title=stored["title"],
        statements=_statements(stored, case),
        certainty=""
        if case is None
        else certainty(stored["error_bars"], stored["without_error_bars"]),
        notes=_notes(stored),
        sections=sections,
        versions=versions(stored["cost"]),
    )


def _statements(stored: dict[str, Any], case: Judged | None) -> tuple[str, ...]:
    if case is not None:
        return statements(case, stored["verdict"])
    path = stored["trajectory"]
    if path is None:
        return ("There is no verdict: the scene asks for none.",)
    moved, missing = trajectory_sentence(path), path["ended"]["without_verdict"]
    return (moved, sentence(f"there is no verdict: {missing}")) if missing else (moved,)


def _notes(stored: dict[str, Any]) -> tuple[str, ...]:
    """What is to be known before anything else."""
    notes = []
    if stored["status"] != "complete":
        why = stored["error"] or "its numbers are preliminary"
        notes.append(sentence(f"the run is {stored['status']}: {why}"))
    gap = stored["gap"]
    if gap is not None and not gap["resolved"]:
        notes.append(
            "The gap between grain and bed is not resolved: give a smaller numerics.mesh_size."
        )
    return tuple(notes)


def _loads(stored: dict[str, Any], planar: bool) -> tuple[PageSection, ...]:
    """Forces, couples, coefficients, gap and extremes."""
    axes = range(2 if planar else 3)
    return section(
        "Forces and couples on the grain",
        _acting("force", stored, axes, "force [scene units]") or words("There is no grain."),
        _acting("couple", stored, (2,) if planar else axes, "couple about the centre of mass"),
        table(("other numbers", ""), _others(stored, planar)),
    )


def _acting(kind: str, stored: dict[str, Any], axes: Sequence[int], head: str) -> Any:
    """The table of forces or of couples by their components along axes; None without a grain."""
    found, bars = stored[kind], stored["error_bars"]
    if found is None:
        return None
    rows: Rows = []
    for key, name in FORCES:
        if not _left_out(key, found):
            errors = bars[kind] if key == "flow" and bars is not None else None
            values = ((found[key][at], errors and errors[at]) for at in axes)
            rows.append(
                (name, *(one if error is None else Erring(one, error) for one, error in values))
            )
    return table((head, *("xyz"[at] for at in axes)), rows)


def _left_out(key: str, loads: dict[str, Any]) -> bool:
    """Whether a row of loads says nothing: no correction."""
    if key == "computed":
        return loads.get(key) in (None, loads["flow"])
    return key not in loads


def _others(stored: dict[str, Any], planar: bool) -> Rows:
    rows: Rows = []
    gap, grain = stored["gap"], stored["grain"]
    if gap is not None:
        name = "closed where narrower than" if gap.get("closed") else "gap between grain and bed"
        rows += [(name, gap["width"]), ("cells across the gap", gap["cells"])]
    if grain is not None:
        rows.append(("centre", components(grain["centre"], planar)))
    return [*_quantities("other numbers", stored), *rows]


def _quantities(heading: str, stored: dict[str, Any]) -> Rows:
    """Rows of the quantities under a heading that the run has, with their error bars."""
    rows: Rows = []
    for one in known.quantities():
        if one.heading == heading and (value := one.value(stored)) is not None:
            bar = one.bar(stored)
            rows.append((one.label, value if bar is None else Bounded(value, *bar)))
    return rows


def _surface(stored: dict[str, Any]) -> tuple[PageSection, ...]:
    """The elevations of a free surface at the end, with their error bars, and what enters below it."""
    found, bars = stored.get("surface"), stored["error_bars"]
    if found is None:
        return ()
    unknown = [None] * len(found["stations"])
    errors = [(bars or {}).get(key) or unknown for key in ("level", "elevation")]
    rows: Rows = [
        (f"({', '.join(f'{x:g}' for x in place)})" if isinstance(place, list) else place, *numbers)
        for place, *numbers in zip(found["stations"], found["elevations"], *errors, strict=True)
    ]
    entering = f"What enters per time: {found['inflow']:.6g}." if "inflow" in found else ""
    head = ("station", "elevation at the end", "its error", "error within the run, at most")
    return section("The free surface", table(head, rows), words(entering))


def _findings(stored: dict[str, Any]) -> Iterator[PageSection]:
    """What effects have found."""
    for found in filter(None, (effect.findings(stored) for effect in known.EFFECTS)):
        rows = [*_quantities(found.heading, stored), *found.rows]
        yield from section(found.title, words(found.sentence), table((found.heading, ""), rows))


def _on_bed(course: dict[str, Any] | None, planar: bool) -> Iterator[tuple[Cell, ...]]:
    """What a grain that moves on its bed has done there."""
    if course is None:
        return
    yield "mode", course["mode"]
    for name in ("first_motion", "left_pocket"):
        if course[name] is not None:
            yield name.replace("_", " "), course[name]
    yield "force of contact", components(course["force"], planar)
    for name, work in course["works"].items():
        yield f"work of {name}", work


def _path(stored: dict[str, Any]) -> tuple[PageSection, ...]:
    """Where a grain that moves has come to."""
    path = stored["trajectory"]
    if path is None:
        return ()
    planar = "angle" in path
    ended = path["ended"]
    rows: Rows = [
        ("time", ended["time"]),
        ("ended by", ended["by"]),
        ("place", components(path["place"], planar)),
        ("velocity", components(path["velocity"], planar)),
        ("spin", path["spin"] if planar else turning(path["spin"], planar)),
        ("turned by", path["angle"])
        if planar
        else ("orientation (quaternion)", tuple(path["quaternion"])),
        ("new meshes", len(path["remeshings"])),
        ("iterations of fluid and grain a step", path["interface_iterations"]["mean"]),
        *_on_bed(path.get("on_bed"), planar),
    ]
    return section("Path of the grain", table(("at the end", ""), rows))
