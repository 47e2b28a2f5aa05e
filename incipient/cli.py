"""The command `incipient`: run, plan, show, new, schema."""

from __future__ import annotations

import argparse
import json
import logging
import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import IncipientError, SceneError

if TYPE_CHECKING:
    from mpi4py import MPI

INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Parse the command line, do it, and return the exit code; the same on all ranks."""
    options = _parser().parse_args(arguments)
    _start_alone_quickly()
    # The libraries below are heard only when something is wrong: the form compiler narrates at level info.
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    logging.getLogger("incipient").setLevel(options.log_level.upper())
    signal.signal(signal.SIGTERM, _as_interrupt)
    return _guarded(options.command, options)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="incipient", description="Does a rigid grain on a rigid bed in a viscous flow begin to move?"
    )
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument(
        "--log-level", choices=("debug", "info", "warning", "error"), default="info", help="how much to say"
    )
    scene = argparse.ArgumentParser(add_help=False)
    scene.add_argument("scene", type=Path, help="scene file (TOML)")
    scene.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="such as fluid.reynolds=40",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, function: Callable[..., int], text: str, *parents: argparse.ArgumentParser) -> Any:
        made = commands.add_parser(name, help=text, description=text, parents=[*parents, common])
        made.set_defaults(command=function)
        return made

    run = command("run", _run, "simulate a scene and judge its grain (also under mpirun)", scene)
    run.add_argument(
        "--out", type=Path, help="directory for the results (default: results/NAME OF THE SCENE)"
    )
    plan = command("plan", _plan, "say what would be computed and what not, and what it needs", scene)
    plan.add_argument("--json", action="store_true", help="as JSON")
    show = command("show", _show, "draw the pictures of a finished run")
    show.add_argument("directory", type=Path, help="directory of the results")
    new = command("new", _new, "write a commented example scene")
    new.add_argument("name", help="name of the scene; NAME.toml is written")
    command("schema", _schema, "print the JSON schema of scenes, for editors")
    return parser


def _run(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .progress import telling

    log = logging.getLogger("incipient") if comm.rank == 0 else _nobody()
    scene = incipient.load(options.scene, options.overrides)
    directory = options.out or Path("results") / options.scene.stem
    log.info(
        "%s on %s\n%s", scene.title or options.scene.stem, _ranks(comm), incipient.make_plan(scene).text()
    )
    with telling(comm.rank) as voice:
        result = incipient.run(scene, directory, comm, voice)
    log.info("%s", result.text())
    pictures = _pictures(directory, comm) if scene.output.pictures else []
    log.info("%s", _whereabouts(directory, scene.output.fields, pictures, result.cost))
    return 0


def _pictures(directory: Path, comm: MPI.Comm) -> list[Path]:
    from .parallel import collectively

    drawn: list[Path] = []
    with collectively(comm):
        if comm.rank == 0:
            from .pictures import draw

            drawn = draw(directory)
    return drawn


def _whereabouts(directory: Path, fields: bool, pictures: list[Path], cost: dict[str, Any]) -> str:
    lines = [f"verdict and numbers {directory / 'result.json'}"]
    if pictures:
        lines.append(f"pictures            {directory}/: {', '.join(path.name for path in pictures)}")
    else:
        lines.append(f"pictures            incipient show {directory}")
    if fields:
        lines.append(f"for ParaView        {directory / 'fields.xdmf'}")
    lines.append(
        f"cost                {cost['wall_time']['total']:.2f} s, {cost['unknowns']} unknowns, "
        f"{cost['peak_memory_mib']:.0f} MiB"
    )
    return "\n".join(lines)


def _plan(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .parallel import collectively
    from .simulation import estimate

    scene = incipient.load(options.scene, options.overrides)
    with collectively(comm):
        if comm.rank == 0:
            plan = estimate(scene)
            print(json.dumps(plan.to_dict(), indent=2) if options.json else plan.text())
    return 0


def _show(options: argparse.Namespace, comm: MPI.Comm) -> int:
    for path in _pictures(options.directory, comm):
        print(path)
    return 0


def _new(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .files import write_text_atomically
    from .parallel import collectively
    from .scene import example

    path = Path(options.name).with_suffix(".toml")
    with collectively(comm):
        if comm.rank == 0:
            if path.exists():
                raise SceneError(f"{path}: exists already; choose another name")
            write_text_atomically(path, example())
            print(f"{path}: edit it, then: incipient run {path}")
    return 0


def _schema(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .scene import schema

    if comm.rank == 0:
        print(json.dumps(schema(), indent=2))
    return 0


# -- surroundings -----------------------------------------------------------------------------------


def _guarded(command: Callable[[argparse.Namespace, MPI.Comm], int], options: argparse.Namespace) -> int:
    """Run a command; turn errors into one line and an exit code, on all ranks, without a hang."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    try:
        return command(options, comm)
    except IncipientError as error:
        # Raised on all ranks alike: rank 0 speaks for all, and all leave in an orderly way.
        if comm.rank == 0:
            print(f"incipient: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        if comm.rank == 0:
            print("incipient: interrupted; what was computed so far is kept", file=sys.stderr, flush=True)
        return _leave(comm, INTERRUPTED)
    except Exception:
        print(f"incipient: a defect of the program, on rank {comm.rank}:", file=sys.stderr)
        traceback.print_exc()
        return _leave(comm, 70)


def _leave(comm: MPI.Comm, code: int) -> int:
    """Other ranks may wait for this one: with several, end them all."""
    sys.stdout.flush()
    sys.stderr.flush()
    if comm.size > 1:
        comm.Abort(code)
    return code


def _as_interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _start_alone_quickly() -> None:
    """Without mpirun, OpenMPI need not start a daemon and look for networks: that takes 0.3 s."""
    if not any(name.startswith(("OMPI_COMM_", "PMI_", "PMIX_", "SLURM_")) for name in os.environ):
        for name, value in (("ess_singleton_isolated", "1"), ("pml", "ob1"), ("btl", "self")):
            os.environ.setdefault(f"OMPI_MCA_{name}", value)


def _nobody() -> logging.Logger:
    logger = logging.getLogger("incipient.silent")
    logger.disabled = True
    return logger


def _ranks(comm: MPI.Comm) -> str:
    return f"{comm.size} rank" + ("s" if comm.size > 1 else "")
