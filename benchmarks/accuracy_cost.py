"""What `make cost` runs: `incipient cost` on the demos, and docs/cost.md from what it leaves.

Runs that results/cost holds already are not made again; delete it to measure anew.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import machine

from incipient.cost import calibration, prediction, solvers
from incipient.cost.command import builtin
from incipient.files import write_json

ROOT = Path(__file__).resolve().parents[1]
STUDIES, PAGE = ROOT / "results" / "cost", ROOT / "docs" / "cost.md"
FIGURES = PAGE.parent / "figures"


@dataclass(frozen=True)
class Scene:
    """A demo, the options of its ladder, and what a reader should know of it."""

    name: str
    options: tuple[str, ...] = ()
    said: str = ""


SCENES = (
    Scene("cavity", said="The errors are those of the extreme velocities on the centrelines."),
    Scene(
        "cylinder", said="Lift is 1/500 of drag here: as part of the force it counts little; see its own row."
    ),
    Scene(
        "vortex_street",
        ("--orders", "2", "3", "--steps", "4", "2", "1"),
        "Largest and least force and couple over the last quarter of the time, five periods of the street.",
    ),
    Scene(
        "grain_on_bed",
        said="A disc on a flat bed rolls in any flow, so that there is no safety factor to err in.",
    ),
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
    parser.add_argument("--page", action="store_true", help="write the page from the studies there are")
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
    write_json(calibration.SHIPPED, calibration.plain(found))
    return 0


def study(scene: Scene) -> None:
    """Make the study of a scene, or finish it, and take its picture into the docs."""
    directory, path = STUDIES / scene.name, ROOT / "demos" / "scenes" / f"{scene.name}.toml"
    command = [sys.executable, "-m", "incipient", "cost", str(path), "--out", str(directory), *scene.options]
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
    made = f"`incipient cost demos/scenes/{scene.name}.toml{options}`. {scene.said}"
    text = "\n\n".join([f"#{title}", made, *parts])
    return text.replace("(cost.png)", f"(figures/{figure.name})")


def _head() -> str:
    about = machine.describe()
    versions = ", ".join(f"{name} {version}" for name, version in machine.versions().items())
    return f"""# What accuracy costs in time

Written by `make cost` (`benchmarks/accuracy_cost.py`); do not edit by hand. The same for any scene: `incipient cost
SCENE`, which leaves this page for it, its picture, `cost.csv` and `cost.json`, and goes on where it was interrupted.

On {about["processor"]}, {about["cores"]} cores, {about["memory_gib"]} GiB, {about["system"]}; {versions}.

**How to read it.** A ladder of runs: orders of the velocity, cell sizes, time steps, ways to solve. A run is *on
the front* if it is better, by a tenth at least, than all that take less processor time. The law,
error = C (t - start)^-p, is fitted to the front in logarithms; *start* is the part of the time that no number of
unknowns changes (libraries, mesh generator, compiled forms). An error in brackets cannot be told apart from that of
the reference, and is not part of the law. Times beyond the runs are marked "about".

**Ways to solve** differ in the algebra, the linearisation, the stabilisation or the scheme in time, on the same cells
and steps. By default the usual ones are tried on the three coarsest variants of the middle order: for steady flow
{_usual(solvers.USUAL_STEADY)},
in time {_usual(solvers.USUAL_IN_TIME)}, as far as the scene does not do so anyway.
Together they tell how error and time go with each other, and so the time a way would take for the error of the scene's
own. One that takes less by a tenth, and less on each of them, is called cheaper; `incipient plan` then says so. What
such studies recommend for all scenes becomes the default.
`--solvers WAY ...` tries those given on all variants instead, `--solvers own` tries none. Words are joined by "+", such
as `extrapolated+bdf1`:

{_ways()}

A way that is as accurate and quicker takes the place of the scene's own on the front, and so in the law. What
`incipient plan` tells of a scene is by runs solved as the scene says.

**Before a run.** `incipient plan SCENE` tells time, memory and error by laws that a study fits to its runs: processor
time t = start + fixed + n^p (a + c m) for n unknowns and m time steps, error E = C h^q + D dt^r for each order, cells h
and steps dt. The laws of every study are kept as this machine's calibration
(`$XDG_CACHE_HOME/incipient/calibration.json`). For a scene that was studied its own are taken, and times are right to a
factor of {prediction.OWN:g}; for others the mean of those of its kind (steady, in time, with a grain that moves;
with turbulence), to a
factor of {prediction.FOREIGN:g}; `plan --study DIRECTORY` goes by the study there. Of error bars the dual solution
counts as a run with its unknowns, a coarse run as one whose mesh is made. `incipient calibrate` studies small scenes of
each kind in a minute or two; until then laws of another machine that come with the program serve, to a factor of
{prediction.ELSEWHERE:g}.
"""


def _usual(words: tuple[str, ...]) -> str:
    return ", ".join(f"*{word}*" for word in words)


def _ways() -> str:
    """The words for ways to solve, one a row."""
    rows = [f"| {word} | {solver.said} |" for word, solver in solvers.WORDS.items()]
    return "\n".join(["| word | way to solve |", "| :-- | :-- |", *rows])


if __name__ == "__main__":
    sys.exit(main())
