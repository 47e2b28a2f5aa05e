"""What `make gallery` runs: the scenes of the demos, a picture of each for docs/gallery.md.

Cost:    a quarter of an hour of processor time; a run whose results are there is not made again.
Run:     python benchmarks/gallery.py [NAME ...]
Results: results/gallery/NAME, docs/figures/gallery/NAME.webp
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
RESULTS, FIGURES = ROOT / "results" / "gallery", ROOT / "docs" / "figures" / "gallery"
WIDE, QUALITY = 900, 80  # of a picture: pixels, per cent
# Scenes, with what is set for the gallery, and the picture that is shown.
SHOWN: dict[str, tuple[str, str]] = {
    "leaving_pocket": ("", "trajectory.png"),
    "pocket_in_gusts": ("", "entrainment.png"),
    "pebble": ("numerics.error_bars=false", "verdict.png"),
    "grain_under_waves": ("numerics.error_bars=false", "verdict.png"),
    "film_over_bump": ("", "elevation.png"),
}


def shown(name: str) -> Path:
    """Run a scene if need be, draw its pictures, and put the one chosen into the docs."""
    directory, (setting, picture) = RESULTS / name, SHOWN[name]
    command = "entrainment" if picture == "entrainment.png" else "run"
    if not (directory / "scene.toml").exists():
        told = ["--set", setting] if setting else []
        incipient(command, ROOT / "demos" / "scenes" / f"{name}.toml", "--out", directory, *told)
    if not (directory / picture).exists():
        incipient("show", directory)
    FIGURES.mkdir(parents=True, exist_ok=True)
    path = FIGURES / f"{name}.webp"
    with Image.open(directory / picture) as image:
        small = image.convert("RGB")
        small.thumbnail((WIDE, WIDE))
        small.save(path, "WEBP", quality=QUALITY)
    return path


def incipient(*arguments: object) -> None:
    """A command, which must succeed."""
    subprocess.run(
        [sys.executable, "-m", "incipient", *map(str, arguments)],
        check=True,
        stdout=subprocess.DEVNULL,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "names", nargs="*", choices=[*SHOWN, []], metavar="NAME", help=", ".join(SHOWN)
    )
    for name in parser.parse_args().names or SHOWN:
        print(shown(name).relative_to(ROOT), flush=True)
