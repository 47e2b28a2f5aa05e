"""The command `incipient`; `_commands` lists what it can do."""

from __future__ import annotations

import argparse
import atexit
import gc
import json
import logging
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from .commands import judge as judge_command
from .commands import report as report_command
from .commands import sweep as sweep_command
from .commands.drawing import tell_of_pictures
from .commands.options import alone, named, overrides
from .errors import IncipientError, OutputError, SceneError
from .installed import required
from .interrupt import nobody_reads
from .parallel import Meeting, ranks_there_are, start_alone_quickly

if TYPE_CHECKING:
    from mpi4py import MPI

    from .results.result import Result

DEFECT, INTERRUPTED = 70, 130
UNREAD = 128 + signal.SIGPIPE  # as of programs that the system ends because nobody reads what they print
# What one of the commands leaves in a directory of results.
RECORDS = ("result.json", "threshold.json", "judgement.json", "cost.json", "series.json", "scene.toml")
TO_COME = 10.0  # seconds in which other ranks come where they have failed as well
TO_SPEAK = 0.5  # seconds that other ranks leave the first to say why, before they end all


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says and return the exit code; the same on all ranks."""
    start_alone_quickly()
    # A last search for garbage would take a tenth of a second, for memory that the system takes back anyway.
    atexit.register(gc.freeze)
    try:
        try:
            return _guarded(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        return UNREAD if nobody_reads() else DEFECT


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line like any other wrong input: in one line, by one rank."""

    def error(self, message: str) -> NoReturn:
        """Raise where the parser of the standard library would print its usage and leave."""
        raise SceneError(f"{message}; see {self.prog} --help")

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike that of newer standard libraries, it fails where nobody reads it any more."""
        print(self.format_help(), end="", file=file)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="incipient", description="Does a rigid grain on a rigid bed in a viscous flow begin to move?"
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (function, text, options) in _commands().items():
        made = commands.add_parser(name, help=text, description=text)
        made.set_defaults(command=function)
        options(made)
        levels = ("debug", "info", "warning", "error")
        made.add_argument("--log-level", choices=levels, default="info", help="how much to say")
    return parser


def _commands() -> dict[str, tuple[Callable[..., int], str, Callable[[argparse.ArgumentParser], None]]]:
    """The commands by name: the function called, the purpose in words, the function that adds the options."""
    return {
        "run": (_run, "simulate a scene and judge its grain (also under mpirun)", _options_of_run),
        "resume": (_resume, "go on with a run that was cut short (also under mpirun)", _options_of_resume),
        "threshold": (
            _threshold,
            "find the flow at which the scene's grain first moves",
            _options_of_threshold,
        ),
        "plan": (_plan, "say what would be computed and what not, and what it needs", _options_of_plan),
        "cost": (
            _cost,
            "find what accuracy costs: error against time, by a ladder of runs",
            _options_of_cost,
        ),
        "calibrate": (
            _calibrate,
            "measure this machine, so that plan can tell times and errors",
            _no_options,
        ),
        "show": (_show, "draw the pictures of a finished run, or animate its flow", _options_of_show),
        "report": (
            report_command.report,
            "write one HTML page of results, to be read anywhere",
            report_command.options_of_report,
        ),
        "sweep": (
            sweep_command.sweep,
            "run, search the threshold of, or judge many cases, kept in one file",
            sweep_command.options_of_sweep,
        ),
        "table": (
            sweep_command.table,
            "print what a sweep has found, a row a case",
            sweep_command.options_of_table,
        ),
        "judge": (
            judge_command.judge,
            "judge forces and contacts given in a case file, without a flow",
            judge_command.options_of_judge,
        ),
        "new": (_new, "write a commented example scene", _options_of_new),
        "schema": (_schema, "print the JSON schema of scenes, for editors", _no_options),
    }


def _no_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command has no options."""


def _scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, help="scene file (TOML)")
    overrides(parser, "fluid.reynolds=40")


def _options_of_run(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument(
        "--out", type=named, help="directory for the results (default: results/NAME OF THE SCENE)"
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="remove an earlier run from the directory even if it can be resumed (default: move it to a numbered one)",
    )


def _options_of_resume(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("directory", type=Path, help="directory of the run")
    overrides(parser, "time.end=20")


def _options_of_threshold(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument(
        "--out", type=named, help="directory for the results (default: results/NAME OF THE SCENE_threshold)"
    )


def _options_of_plan(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument(
        "--study",
        type=named,
        metavar="DIRECTORY",
        help="of incipient cost, to go by (default: the last of this scene on this machine, else those of others)",
    )


def _options_of_cost(parser: argparse.ArgumentParser) -> None:
    _scene(parser)
    parser.add_argument(
        "--out", type=named, help="directory for the study (default: results/NAME OF THE SCENE_cost)"
    )
    parser.add_argument("--quick", action="store_true", help="a few coarse runs only")
    parser.add_argument(
        "--orders", type=int, nargs="+", metavar="ORDER", help="orders of the velocity, 2 to 4"
    )
    for name, what in (("--sizes", "cell sizes"), ("--steps", "time steps")):
        text = f"{what} as multiples of the scene's"
        parser.add_argument(name, type=float, nargs="+", metavar="FACTOR", help=text)
    parser.add_argument(
        "--solvers",
        nargs="+",
        metavar="WAY",
        help="solver options on all meshes, such as extrapolated+bdf1; own: none but the scene's (default: some, on "
        "three coarse meshes)",
    )


def _options_of_show(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("directory", type=Path, help="directory of the results, or the file of a sweep")
    sweep_command.options_of_show(parser)
    films = parser.add_mutually_exclusive_group()
    films.add_argument("--animate", action="store_true", help="show the flow in motion instead")
    films.add_argument("--turntable", action="store_true", help="go once round a grain in space instead")
    parser.add_argument("--out", type=named, metavar="FILE", help="the film, .gif or .mp4")
    fields = ("velocity", "pressure", "vorticity")
    parser.add_argument("--field", choices=fields, help="what to animate (default: velocity)")


def _options_of_new(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", help="name of the scene; NAME.toml is written")
    parser.add_argument("--space", action="store_true", help="a scene in three dimensions")


def _run(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .progress import telling

    log = logging.getLogger("incipient") if comm.rank == 0 else _nobody()
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / options.scene.stem
    log.info(
        "%s on %s\n%s", scene.title or options.scene.stem, _ranks(comm), incipient.make_plan(scene).text()
    )
    with telling(comm.rank) as voice:
        result = incipient.run(scene, directory, comm, voice, options.overwrite)
    _tell(result, directory, comm)
    return 0


def _resume(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .progress import telling

    _require_left_by(options.directory, ("scene.toml",), comm)
    with telling(comm.rank) as voice:
        result = incipient.resume(options.directory, options.overrides, comm, voice)
    _tell(result, options.directory, comm)
    return 0


def _tell(result: Result, directory: Path, comm: MPI.Comm) -> None:
    """Say what came out and where it is; then draw the pictures if the scene wants some."""
    output = result.scene["output"]
    if comm.rank == 0:
        print(result.text())
        print(_whereabouts(directory, output["fields"], result.cost), flush=True)
    tell_of_pictures(directory, output["pictures"], comm)


def _threshold(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .progress import telling

    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_threshold"
    with telling(comm.rank) as voice:
        threshold = incipient.threshold(scene, directory, comm, voice)
    if comm.rank == 0:
        print(threshold.text())
        print(f"numbers             {directory / 'threshold.json'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0


def _whereabouts(directory: Path, fields: bool, cost: dict[str, Any]) -> str:
    lines = [f"verdict and numbers {directory / 'result.json'}"]
    if fields:
        lines.append(f"for ParaView        {directory / 'fields.xdmf'}")
    lines.append(
        f"cost                {cost['wall_time']['total']:.2f} s, {cost['unknowns']} unknowns, "
        f"{cost['peak_memory_mib']:.0f} MiB"
    )
    return "\n".join(lines)


def _plan(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .cost.command import predicted_plan
    from .parallel import collectively

    scene = incipient.load(options.scene, options.overrides, comm)
    with collectively(comm):
        if comm.rank == 0:
            found = predicted_plan(scene, options.study)
            print(json.dumps(found.to_dict(), indent=2) if options.json else found.text())
    return 0


def _cost(options: argparse.Namespace, comm: MPI.Comm) -> int:
    import incipient

    from .cost import command as cost_command
    from .output.lock import locked

    alone("cost", comm)
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_cost"
    lists = {name: getattr(options, name) for name in ("orders", "sizes", "steps", "solvers")}
    spread = cost_command.chosen(scene, options.quick, **lists)
    with locked(directory, comm, make=True):
        found = cost_command.study(scene, directory, spread, logging.getLogger("incipient").info)
    print(cost_command.summary(found, directory), flush=True)
    tell_of_pictures(directory, True, comm)
    return 0


def _calibrate(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .cost.command import calibrate

    alone("calibrate", comm)
    print(calibrate(logging.getLogger("incipient").info))
    return 0


def _require_left_by(directory: Path, names: Sequence[str], comm: MPI.Comm) -> None:
    """Refuse what is not a directory in which an earlier command has left one of its files. Collective."""
    from .parallel import collectively

    with collectively(comm):
        if comm.rank == 0 and not any((directory / name).is_file() for name in names):
            why = "is not the directory of a run" if directory.is_dir() else "there is no such directory"
            raise SceneError(f"{directory}: {why}; give the directory that a run was written to")


def _show(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .parallel import collectively

    if options.directory.suffix == ".toml":
        why = "is a scene and no results"
        raise SceneError(
            f"{options.directory}: {why}; run it, then give the directory that the run was written to"
        )
    if options.directory.is_file():
        return sweep_command.show(options, comm)
    sweep_command.refuse_options_of_show(options)
    _require_left_by(options.directory, RECORDS, comm)
    if options.field is not None and not options.animate:
        raise SceneError("--field says what to animate; add --animate")
    if options.out is not None and not (options.animate or options.turntable):
        raise SceneError("--out names the animation; add --animate or --turntable")
    with collectively(comm):
        if comm.rank == 0:
            _show_one(options)
    return 0


def _show_one(options: argparse.Namespace) -> None:
    from .pictures.apart import animate_apart, turn_apart

    if options.animate:
        print(animate_apart(options.directory, options.out, options.field or "velocity"))
    elif options.turntable:
        print(turn_apart(options.directory, options.out))
    else:
        _show_pictures(options.directory)


def _show_pictures(directory: Path) -> None:
    from .pictures.apart import draw_apart

    drawn = draw_apart(directory)
    for path in drawn.paths:
        print(path)
    if drawn.complaint:
        raise OutputError(drawn.complaint)


def _new(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .files import write_text_atomically
    from .parallel import collectively
    from .scene import example

    path = Path(options.name.removesuffix(".toml") + ".toml")
    if path.name == ".toml" or not options.name.strip():
        raise SceneError(f'"{options.name}" is no name of a scene; give one, as in incipient new grain')
    with collectively(comm):
        if comm.rank == 0:
            if path.exists():
                raise SceneError(f"{path}: exists already; choose another name")
            write_text_atomically(path, example(options.space))
            print(f"{path}: edit it, then: incipient run {path}")
    return 0


def _schema(options: argparse.Namespace, comm: MPI.Comm) -> int:
    from .scene import schema

    if comm.rank == 0:
        print(json.dumps(schema(), indent=2))
    return 0


# -- surroundings -----------------------------------------------------------------------------------


def _guarded(arguments: Sequence[str] | None) -> int:
    """Run the command; turn errors into one line and an exit code, on all ranks, without a hang."""
    comm = ranks_there_are()
    meeting = Meeting(comm)
    try:
        options = _parser().parse_args(arguments)
        _listen(options.log_level)
        signal.signal(signal.SIGTERM, _as_interrupt)
        with required():
            code = int(options.command(options, comm))
        meeting.failed(False)
        return code
    except IncipientError as error:
        failed = meeting.failed(True, TO_COME)
        if not failed:  # others are elsewhere, and may wait for this one
            print(f"incipient: on rank {comm.rank} alone: {error}", file=sys.stderr)
            return _leave(comm, error.exit_code)
        # Mostly raised on all ranks alike: the first of them speaks for all, and all leave in an orderly way.
        if comm.rank == failed.index(True):
            print(f"incipient: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        if comm.rank == 0:
            print("incipient: interrupted; what was computed so far is kept", file=sys.stderr, flush=True)
        return _leave(comm, INTERRUPTED)
    except Exception as error:
        if isinstance(error, BrokenPipeError) and nobody_reads():
            return _leave(comm, UNREAD)
        print(f"incipient: a defect of the program, on rank {comm.rank}:", file=sys.stderr)
        traceback.print_exc()
        return _leave(comm, DEFECT)


def _listen(level: str) -> None:
    """Show this program's messages from a level on, and those of the libraries below from warnings on."""
    shown = logging.StreamHandler(sys.stderr)
    # A level of the root logger would not last: compiling a form sets it to info, and the compiler narrates.
    shown.addFilter(lambda record: record.levelno >= logging.WARNING or record.name.startswith("incipient"))
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[shown])
    logging.getLogger("incipient").setLevel(level.upper())


def _leave(comm: MPI.Comm, code: int) -> int:
    """Other ranks may wait for this one: with several, end them all."""
    sys.stdout.flush()
    sys.stderr.flush()
    if comm.size > 1:
        if comm.rank:
            time.sleep(TO_SPEAK)
        comm.Abort(code)
    return code


def _as_interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _nobody() -> logging.Logger:
    logger = logging.getLogger("incipient.silent")
    logger.disabled = True
    return logger


def _ranks(comm: MPI.Comm) -> str:
    return f"{comm.size} rank" + ("s" if comm.size > 1 else "")
