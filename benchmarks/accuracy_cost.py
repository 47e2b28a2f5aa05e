"""What `make cost` runs: `incipient cost` on some demos, and docs/validation/cost.md from what it leaves.

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
import tables

from incipient.cost.frontier import percent

ROOT = Path(__file__).resolve().parents[1]
STUDIES, FIGURES = ROOT / "results" / "cost", tables.DOCS / "figures"


@dataclass(frozen=True)
class Demo:
    """A demo, the options of its ladder, and what a reader should know of it."""

    name: str
    options: tuple[str, ...] = ()
    said: str = ""

    @property
    def directory(self) -> Path:
        """Where its study lies."""
        return STUDIES / self.name

    @property
    def command(self) -> str:
        """The command that makes its study."""
        return " ".join(("incipient cost", f"demos/scenes/{self.name}.toml", *self.options))


DEMOS = (
    Demo("cavity"),
    Demo("grain_on_bed"),
    Demo(
        "sphere_on_plane",
        said="In 3-D the order is not varied: order 3 is the cheapest in creeping flow.",
    ),
    Demo(
        "vortex_street",
        said="Largest and least force and torque over the last quarter of the time, five periods of the street.",
    ),
    Demo(
        "pothole_4",
        ("--sizes", "2", "1.41421", "1", "0.707107", "--steps", "4", "2", "1", "0.5", "0.25"),
        "Where the free bead is at the end, relative to the length of its path, and its rotation.",
    ),
    Demo(
        "standing_wave",
        said="Elevations at both ends and in the middle at sixteen times in three periods.",
    ),
    Demo(
        "turbulent_channel",
        said="u* at the outflow; the relative error of C_f is twice as large. k and epsilon have order 2.",
    ),
    Demo("large_grain", ("--orders", "2"), "Force, torque and safety factor, k-epsilon model."),
    Demo("pocket_in_gusts", ("--do", "threshold"), "The flow at which the grain first moves."),
)


def main() -> int:
    """Make the studies that are asked for, then the page from all there are."""
    parser = argparse.ArgumentParser(description="What accuracy costs, on the demos.")
    parser.add_argument("--only", action="append", choices=[demo.name for demo in DEMOS])
    parser.add_argument(
        "--page", action="store_true", help="write the page from the studies there are"
    )
    options = parser.parse_args()
    for demo in DEMOS:
        if not options.page and (options.only is None or demo.name in options.only):
            print(f"--- {demo.name}", file=sys.stderr, flush=True)
            words = [*demo.command.split()[1:], "--out", str(demo.directory)]
            subprocess.run([sys.executable, "-m", "incipient", *words], cwd=ROOT, check=True)
    about, own = machine.describe(), machine.versions()["incipient"]
    where = f"{about['processor']}, {about['cores']} cores, {about['memory_gib']} GiB, {about['system']}"
    parts = [f"Machine: {where}; incipient {own}.", *map(_section, DEMOS)]
    tables.publish("cost", "\n\n".join(parts))
    return 0


def _section(demo: Demo) -> str:
    """A study on the page: its sentence and its picture."""
    if not (demo.directory / "cost.png").exists():
        return f"## {demo.name}\n\nNot measured yet."
    figure = FIGURES / f"cost_{demo.name}.png"
    shutil.copyfile(demo.directory / "cost.png", figure)
    stored = json.loads((demo.directory / "cost.json").read_text())
    reference, doubt = stored["reference"], stored["reference"]["doubt"]
    names = ", ".join(reference["quantities"])
    known = f", known to {percent(doubt)}" if doubt else ""
    parts = [
        f"## {stored['title']}",
        f"`{demo.command}`. {demo.said}".rstrip(),
        f"**{stored['sentence']}**",
        f"![Error against CPU time and memory](../figures/{figure.name})",
        f"Largest relative error of {names}. Reference: {reference['source']}{known}.",
    ]
    return "\n\n".join(parts)


if __name__ == "__main__":
    sys.exit(main())
