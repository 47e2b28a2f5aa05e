"""Every command that the pages tell people to type, run once: `make docs-commands` (PAGE=howto/sweeps.md for one).

Each page has a directory of its own below build/docs-commands, with the files that the page tells people to write.
Commands of a page run one after the other; a later call goes on where the one before was ended. `srun` becomes
`mpirun -n 3`, cells are coarse where the page leaves their size open, and `make` only says what it would do.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCRATCH = ROOT / "build/docs-commands"
LIMIT = 3600.0  # seconds for a command
COARSE = ["--set", "numerics.mesh_size=3"]
SIZED = ("run", "threshold", "sweep", "plan")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.M | re.S)
WRITTEN = re.compile(r"as `([\w.]+\.toml)`:\s*\n\s*```toml\n(.*?)^```", re.M | re.S)
FORCES = "time,force_x,force_y,couple\n" + "".join(
    f"{t},{0.2 + 0.3 * t},0,-0.04\n" for t in range(4)
)
# A placeholder such as SCENE or CASE.toml stands for a file of the reader's.
PLACEHOLDER = re.compile(r"\b[A-Z]{3,}(?:\.\w+)?\b")


@dataclass(frozen=True)
class Command:
    """A command as a page has it."""

    page: str
    text: str

    @property
    def words(self) -> list[str]:
        """Its words, comments left out."""
        return shlex.split(self.text, comments=True)

    @property
    def program(self) -> list[str]:
        """The words from the program on: without what starts ranks, and without a directory."""
        words = self.words
        at = next(
            i for i, word in enumerate(words) if Path(word).name in ("incipient", "python", "make")
        )
        return [Path(words[at]).name, *words[at + 1 :]]


def pages() -> list[Path]:
    """The README and all pages."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands(page: Path) -> Iterator[Command]:
    """What a page tells people to type, line by line, those of the project's own programs."""
    name = str(page.relative_to(ROOT))
    for kind, block in BLOCK.findall(page.read_text()):
        if kind not in ("sh", "bash", "console"):
            continue
        for line in block.replace("\\\n", " ").splitlines():
            text = line.strip().removeprefix("$ ")
            if re.match(
                r"(?:\w+=\S+ )*(?:(?:mpirun -n \d+|srun) )?(?:\S*/)?(?:incipient|python|make)\b",
                text,
            ):
                yield Command(name, text)


def main() -> int:
    """Run what has not been run; say what failed."""
    chosen = sys.argv[1:]
    failed = []
    for page in pages():
        if chosen and str(page.relative_to(ROOT)) not in (
            *chosen,
            *(f"docs/{one}" for one in chosen),
        ):
            continue
        directory = _prepared(page)
        done = (
            json.loads((directory / "done.json").read_text())
            if (directory / "done.json").exists()
            else []
        )
        for command in commands(page):
            if command.text in done or PLACEHOLDER.search(command.text.partition("#")[0]):
                continue
            code, seconds = _run(command, directory)
            print(
                f"{command.page}: {command.text}: {'done' if code == 0 else f'CODE {code}'} in {seconds:.0f} s",
                flush=True,
            )
            if code:
                failed.append(command)
                continue
            done.append(command.text)
            (directory / "done.json").write_text(json.dumps(done, indent=1))
    print(f"{len(failed)} failed" + "".join(f"\n  {one.page}: {one.text}" for one in failed))
    return 1 if failed else 0


def _prepared(page: Path) -> Path:
    """The directory of a page, with the files that its reader has."""
    directory = SCRATCH / page.relative_to(ROOT).with_suffix("")
    directory.mkdir(parents=True, exist_ok=True)
    for name in ("demos", "tests", "benchmarks", "Makefile"):
        if not (directory / name).exists():
            (directory / name).symlink_to(ROOT / name)
    for name in ("pebble.toml", "pebble.stl"):
        (directory / name).write_bytes((ROOT / "demos/scenes" / name).read_bytes())
    (directory / "forces.csv").write_text(FORCES)
    for source in (*sorted((ROOT / "docs/tutorials").glob("*.md")), page):
        for name, text in WRITTEN.findall(source.read_text()):
            (directory / name).write_text(text)
    return directory


def _run(command: Command, directory: Path) -> tuple[int, float]:
    """Run a command with what must be there before; exit code and seconds."""
    began = time.monotonic()
    for words in (*_needed(command, directory), _as_run(command)):
        code = _finished(words, directory)
        if code:
            break
    return code, time.monotonic() - began


def _needed(command: Command, directory: Path) -> Iterator[list[str]]:
    """Commands that make the files which a command takes for granted."""
    words = command.program[1:]
    if "mine.toml" in words and not (directory / "mine.toml").exists():
        yield [
            "incipient",
            "new",
            "mine",
            *(["--space"] if "three_dimensions" in command.page else []),
        ]
    for result in (
        word
        for word in words[1:2]
        if word.startswith("results/") and not (directory / word).exists()
    ):
        stem = result.removeprefix("results/").removesuffix(".sqlite")
        base, _, task = stem.partition("_threshold")
        scene = next(
            (f for f in (f"{base}.toml", f"demos/scenes/{base}.toml") if (directory / f).exists()),
            "mine.toml",
        )
        if scene == "mine.toml" and not (directory / scene).exists():
            yield ["incipient", "new", "mine"]
        if result.endswith(".sqlite"):
            yield [
                "incipient",
                "sweep",
                scene,
                "--over",
                "fluid.reynolds=1,4",
                "--do",
                "threshold",
                "--out",
                result,
                *COARSE,
            ]
        else:
            do = "threshold" if stem != base or task else "run"
            yield ["incipient", do, scene, "--out", result, *COARSE]


def _as_run(command: Command) -> list[str]:
    """The words that are run in place of those of a page."""
    words, program = command.words, command.program
    starts = words[: len(words) - len(program)]
    if program[0] == "make":
        return ["make", "--directory", str(ROOT), "--dry-run", *program[1:]]
    if any(Path(word).name in ("srun", "mpirun") for word in starts):
        number = starts[starts.index("-n") + 1] if "-n" in starts else "3"
        ranks = ["mpirun", "-n", number, "--oversubscribe", "--bind-to", "none"]
        starts = [word for word in starts if "=" in word] + ranks
    coarse = (
        len(program) > 1
        and program[1] in SIZED
        and not any("mesh_size" in w or "demos/" in w for w in program)
    )
    return [*starts, *program, *(COARSE if coarse else [])]


def _finished(words: list[str], directory: Path) -> int:
    """The exit code of a command with the project's own programs first in the path; 124 where the time was up."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    variables = dict(word.split("=", 1) for word in words if re.match(r"[A-Z_]+=", word))
    words = [word for word in words if not re.match(r"[A-Z_]+=", word)]
    surroundings = {**os.environ, **variables, "PATH": path, "OMP_NUM_THREADS": "1"}
    with (directory / "log.txt").open("a") as log:
        log.write(f"$ {shlex.join(words)}\n")
        log.flush()
        try:
            return subprocess.run(
                words, cwd=directory, env=surroundings, stdout=log, stderr=log, timeout=LIMIT
            ).returncode
        except subprocess.TimeoutExpired:
            return 124


if __name__ == "__main__":
    sys.exit(main())
