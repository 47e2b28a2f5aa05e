"""What `make cost` runs: `incipient cost` on the demos, and docs/cost.md from what it leaves.

Runs that results/cost holds already are not made again; delete it to measure anew.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import machine

from incipient.cost import calibration, prediction, solvers
from incipient.cost.command import builtin
from incipient.files import write_text_atomically

ROOT = Path(__file__).resolve().parents[1]
STUDIES, PAGE = ROOT / "results" / "cost", ROOT / "docs" / "cost.md"
FIGURES = PAGE.parent / "figures"
# Beginnings of parts of a study that are only in its own cost.md: all runs, laws by quantity, a summary of a table.
LEFT_OUT = ("| run ", "error = C", "| quantity ", "**1%", "**Solver options**")


@dataclass(frozen=True)
class Scene:
    """A demo, the options of its ladder, and what a reader should know of it."""

    name: str
    options: tuple[str, ...] = ()
    said: str = ""


SCENES = (
    Scene("cavity"),
    Scene("cylinder"),
    Scene(
        "vortex_street",
        ("--orders", "2", "3", "--steps", "4", "2", "1"),
        "Largest and least force and couple over the last quarter of the time, five periods of the street.",
    ),
    Scene("grain_on_bed"),
    Scene(
        "pothole_4",
        (
            *("--orders", "2", "3", "--sizes", "2", "1.41421", "1", "0.707107", "0.5"),
            *("--steps", "4", "2", "1", "0.5", "0.25"),
        ),
        "Where the free bead is at the end, relative to the length of its path, and its turn.",
    ),
    Scene(
        "standing_wave",
        (
            *("--orders", "2", "3", "--sizes", "4", "2.82843", "2", "1.41421"),
            *("--steps", "8", "4", "2", "1", "--solvers", "own"),
        ),
        "Elevations at both ends and in the middle at sixteen times in three periods, relative to those together.",
    ),
    Scene(
        "turbulent_channel",
        said="u* at the outflow; the error of C_f is twice as much, relative. k and epsilon have order two.",
    ),
    Scene(
        "large_grain",
        ("--orders", "2", "--sizes", "2", "1.41421", "1", "0.707107"),
        "Force, couple and safety factor by the k-epsilon model.",
    ),
)


def main() -> int:
    """Make the studies that are asked for, then the page from all there are."""
    parser = argparse.ArgumentParser(description="What accuracy costs, on the demos.")
    parser.add_argument("--only", action="append", choices=[scene.name for scene in SCENES])
    parser.add_argument(
        "--page", action="store_true", help="write the page from the studies there are"
    )
    parser.add_argument(
        "--ship", action="store_true", help="let the program come with this machine's calibration"
    )
    options = parser.parse_args()
    if options.ship:
        return ship()
    for scene in SCENES:
        if not options.page and (options.only is None or scene.name in options.only):
            study(scene)
    PAGE.write_text(page())
    return 0


def ship() -> int:
    """Write what `incipient calibrate` has found on this machine where the program keeps what it comes with."""
    scenes = {calibration.digest(scene) for scene in builtin().values()}
    found = {digest: known for digest, known in calibration.read().items() if digest in scenes}
    lines = [
        f"{json.dumps(digest)}: {json.dumps(one)}"
        for digest, one in calibration.plain(found).items()
    ]
    write_text_atomically(calibration.SHIPPED, "{\n" + ",\n".join(lines) + "\n}\n")
    return 0


def study(scene: Scene) -> None:
    """Make the study of a scene, or finish it, and take its picture into the docs."""
    directory, path = STUDIES / scene.name, ROOT / "demos" / "scenes" / f"{scene.name}.toml"
    command = [
        sys.executable,
        "-m",
        "incipient",
        "cost",
        str(path),
        "--out",
        str(directory),
        *scene.options,
    ]
    print(f"--- {scene.name}", file=sys.stderr, flush=True)
    subprocess.run(command, cwd=ROOT, check=True)


def page() -> str:
    """docs/cost.md: a section for each study that is finished."""
    return "\n".join([_head(), *(_section(scene) for scene in SCENES)])


def _section(scene: Scene) -> str:
    source = STUDIES / scene.name
    if not (source / "cost.md").exists():
        return f"## {scene.name}\n\nNot measured yet.\n"
    figure = FIGURES / f"cost_{scene.name}.png"
    shutil.copyfile(source / "cost.png", figure)
    title, *parts = (source / "cost.md").read_text().split("\n\n")
    options = " ".join(("", *scene.options))
    made = f"`incipient cost demos/scenes/{scene.name}.toml{options}`. {scene.said}".rstrip()
    text = "\n\n".join([f"#{title}", made, *filter(None, map(_brief, parts))])
    return text.replace("(cost.png)", f"(figures/{figure.name})").rstrip() + "\n"


def _brief(part: str) -> str:
    """Shortens a paragraph or table of a study: this page explains once what every study explains."""
    if part.startswith(LEFT_OUT):
        return ""
    if part.startswith("| accuracy "):
        return _listed(part)
    if part.startswith("| solver option "):
        rows = (row.strip("| ").split(" | ") for row in part.splitlines()[2:])
        return f"Time at equal errors: {', '.join(f'*{cells[0]}* {cells[1]}' for cells in rows)}."
    if part.startswith("The error is "):
        said, _, good = part.removeprefix("The error is ").partition("). ")[0].partition(" (")
        said = said.replace(
            "largest of the relative errors", "largest relative error"
        ).removeprefix("the ")
        return f"Error: {said} ({good.rpartition('itself ')[2]})."
    return part


def _listed(table: str) -> str:
    """Accuracy, processor time and run of each row as a list; of rows that differ in the accuracy alone the last."""
    rows = [row.strip("| ").split(" | ") for row in table.splitlines()[2:]]
    ends = [(cells[1], cells[-1]) for cells in rows]
    return (
        "\n".join(
            f"- {cells[0]}: {time} {run}"
            if time.startswith("x ")
            else f"- {cells[0]}: {time} ({run})"
            for cells, (time, run), following in zip(rows, ends, [*ends[1:], None], strict=True)
            if (time, run) != following
        )
        .replace(" (finer than any here)", "")
        .replace(" of the time beyond ", " after ")
    )


def _head() -> str:
    about = machine.describe()
    own = machine.versions()["incipient"]
    return f"""# Cost of accuracy

How much time and memory a result takes for the accuracy that you want: before a run, by a study of your scene, or from
the studies of some demos below.

```sh
incipient plan mine.toml   # time, memory and error of this run, by what is known of this machine
incipient calibrate        # one or two minutes, once a machine: plans then have its times
incipient cost mine.toml   # a study of any scene: tables (cost.md), picture, cost.csv, cost.json; resumes
make cost                  # writes this page by `benchmarks/accuracy_cost.py`: do not edit it by hand
```

Machine: {about["processor"]}, {about["cores"]} cores, {about["memory_gib"]} GiB, {about["system"]}; incipient {own}.

## Studies

A study runs a scene with several orders, cell sizes, time steps and solver options, without error bars and with forms
compiled before. Errors are against the finest run, extrapolated where possible; couple means torque. Each scene below
has a list of accuracies: processor time and the cheapest run that reached it. The law \\(E = C (t - t_0)^{{-p}}\\),
fitted to the best runs, gives times beyond the runs ("about"); \\(t_0\\) is that of libraries, meshing and forms.

## Solver options

The usual ones (steady: {_usual(solvers.USUAL_STEADY)}; in time:
{_usual(solvers.USUAL_IN_TIME)}) are tried on the three coarsest variants of the middle order.
`--solvers OPTION ...` tries the given ones on all variants, `--solvers own` none; `extrapolated+bdf1` joins two:

{_ways()}

*Time at equal errors* is relative to the scene's own options, without the start. `incipient plan` names an option that
takes less by a tenth, and less on every variant.

## Time and error before a run

The plan predicts processor time and, for each order, the error by laws fitted to studies, for n unknowns, m time steps
and cells h: \\(t = t_0 + f + n^p (a + c m)\\), \\(E = C h^q + D \\Delta t^r\\). Dual solutions and coarse runs of the
error bars count as runs. The laws of every study are kept as this machine's calibration
(`$XDG_CACHE_HOME/incipient/calibration.json`); `plan --study DIRECTORY` takes those of one study. Processor time is
right to a factor of

- {prediction.OWN:g} by a study of the same scene
- {prediction.FOREIGN:g} by the mean of studies of this kind (steady, in time, with a moving grain, turbulent)
- {prediction.ELSEWHERE:g} by studies of another machine, shipped with the program
"""


def _usual(words: tuple[str, ...]) -> str:
    return ", ".join(f"*{word}*" for word in words)


def _ways() -> str:
    """The words for solver options: those that are values of a key, key by key, and what the others are."""
    keys: dict[str, list[str]] = {}
    for word, one in solvers.WORDS.items():
        if key := _value_of(one):
            keys.setdefault(key, []).append(f"*{word}*")
    values = ", ".join(f"{', '.join(words)} (`{key}`)" for key, words in keys.items())
    others = [
        f"- *{word}*: {one.said} (`{_set_by(one)}`)"
        for word, one in solvers.WORDS.items()
        if not _value_of(one)
    ]
    return "\n".join([f"- values of a key: {values}", *others])


def _value_of(solver: solvers.Solver) -> str:
    """The key of a scene of which an option is one value, or an empty string."""
    sections = {"numerics": solver.numerics, "time": solver.time}
    keys = [f"{name}.{key}" for name, found in sections.items() for key in found]
    return keys[0] if len(keys) == 1 and solver.looser == 1.0 and not solver.petsc else ""


def _set_by(solver: solvers.Solver) -> str:
    """What sets an option that is not one value of a key."""
    return f'PETSC_OPTIONS="{solver.petsc}"' if solver.petsc else "numerics.tolerance"


if __name__ == "__main__":
    sys.exit(main())
