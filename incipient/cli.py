"""The command line."""

from __future__ import annotations

import argparse
import atexit
import difflib
import gc
import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module, metadata
from typing import Any, NoReturn

from .commands.options import COMMANDS, RETIRED
from .errors import IncipientError, OutputError, SceneError, shortened
from .input_files import cause_of
from .installed import required
from .interrupt import SIGNALS, comes_of_interrupt, nobody_reads, open_streams, output_is_lost, say
from .parallel import Comm, Meeting, on_first, ranks_there_are, start_alone_quickly

DEFECT, INTERRUPTED = 70, 130
UNREAD = 128 + signal.SIGPIPE  # as of programs ended by the system because of a closed pipe
_MORE = "reduce the problem, or allow more memory"
# Message of the loader of libraries without memory.
_UNLOADED = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")
TO_COME = 10.0  # seconds within which other failed ranks arrive
TO_SPEAK = 0.5  # seconds for the first rank's message before others end the run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code, equal on all ranks."""
    open_streams()
    try:
        start_alone_quickly()
    except OutputError as error:
        say(f"incipient: {error}")
        return error.exit_code
    # A final garbage collection would take a tenth of a second without benefit.
    atexit.register(gc.freeze)
    try:
        try:
            return _guarded(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        return UNREAD if nobody_reads() else DEFECT
    except OSError as error:
        return _unwritten(error) if output_is_lost(error) else DEFECT


class _Parser(argparse.ArgumentParser):
    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, and refuse unknown options here, where those of the command are known."""
        chosen, unknown = super().parse_known_args(args, namespace)
        if unknown:
            option = unknown[0].partition("=")[0]
            near = difflib.get_close_matches(option, self._option_string_actions, 1)
            meant = f" (did you mean {near[0]}?)" if near else ""
            self.error(f"unrecognized arguments: {shortened(' '.join(unknown))}{meant}")
        return chosen, unknown

    def error(self, message: str) -> NoReturn:
        raise SceneError(f"{message}; see {self.prog} --help")

    def print_help(self, file: Any = None) -> None:
        """Print the help; fails on a closed output, unlike newer standard libraries."""
        print(self.format_help(), end="", file=file)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="incipient",
        description="Does a rigid grain on a rigid bed in a viscous flow begin to move?",
    )
    version = f"%(prog)s {metadata.version('incipient')}"
    parser.add_argument("--version", action="version", version=version)
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    for name, command in COMMANDS.items():
        sub = commands.add_parser(name, help=command.text, description=command.text)
        command.add_options(sub)
        levels = ("debug", "info", "warning", "error")
        sub.add_argument("--log-level", choices=levels, default="info", help="how much to report")
    for name in RETIRED:  # not listed without a help; whatever follows is its own
        retired = commands.add_parser(name, prefix_chars="\0", add_help=False)
        retired.add_argument("rest", nargs="*")
    return parser


def _run(chosen: argparse.Namespace, comm: Comm) -> int:
    name = chosen.command
    if name in RETIRED:
        raise SceneError(f"{name}: is retired; {RETIRED[name]}")
    _listen(chosen.log_level)
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _as_interrupt)
    COMMANDS[name].check(chosen)
    with _system_errors_reported(), required():
        function = getattr(import_module(f".commands.{COMMANDS[name].module}", __package__), name)
        if not COMMANDS[name].on_first:
            return int(function(chosen, comm))
        on_first(comm, function, chosen)
    return 0


def _guarded(arguments: Sequence[str] | None) -> int:
    comm = ranks_there_are()
    meeting = Meeting(comm)
    try:
        code = _run(_parser().parse_args(arguments), comm)
        meeting.failed(False)
        return code
    except IncipientError as error:
        failed = meeting.failed(True, TO_COME)
        if not failed:  # others may wait for this one
            say(f"incipient: on rank {comm.rank} alone: {error}")
            return _leave(comm, error.exit_code)
        # Usually raised on all ranks: the first reports, and all exit normally.
        if comm.rank == failed.index(True):
            say(f"incipient: {error}")
        return error.exit_code
    except BaseException as error:
        if comes_of_interrupt(error):
            if comm.rank == 0:
                say("incipient: interrupted; what was computed so far is kept")
            return _leave(comm, INTERRUPTED)
        if not isinstance(error, Exception):
            raise
        if isinstance(error, BrokenPipeError) and nobody_reads():
            return _leave(comm, UNREAD)
        if output_is_lost(error):
            return _leave(comm, _unwritten(error))
        words = traceback.format_exc().rstrip()
        say(f"incipient: internal error, please report it; rank {comm.rank}:\n{words}")
        return _leave(comm, DEFECT)


def _unwritten(error: Exception) -> int:
    why = getattr(error, "strerror", error)
    say(f"incipient: the standard output cannot be written ({why}); results in files are whole")
    return OutputError.exit_code


@contextmanager
def _system_errors_reported() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except RuntimeError as error:
        options = os.environ.get("PETSC_OPTIONS")
        if not options or type(error).__module__ != "petsc4py.PETSc":
            raise
        why = shortened(str(error).splitlines()[-1])
        raise SceneError(
            f"PETSc failed with PETSC_OPTIONS={shortened(options)} ({why}); correct them or leave them out"
        ) from error
    except MemoryError as error:
        why = shortened(error) or "an allocation failed"
        raise OutputError(f"the memory is too small ({why}); {_MORE}") from error
    except (OSError, ImportError) as error:
        if any(words in str(error) for words in _UNLOADED):
            raise OutputError(f"the memory is too small ({shortened(error)}); {_MORE}") from error
        # From a library, or for the standard output.
        if isinstance(error, ImportError) or not error.errno or error.filename is None:
            raise
        remedy = "choose another name or directory, or free some space"
        name = shortened(error.filename, 300)
        raise OutputError(f"{name}: {cause_of(error)}; {remedy}") from error


def _listen(level: str) -> None:
    shown = logging.StreamHandler(sys.stderr)
    # The root logger's level is changed by the compilation of forms, which logs at level info.
    shown.addFilter(
        lambda record: record.levelno >= logging.WARNING or record.name.startswith("incipient")
    )
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[shown])
    logging.getLogger("incipient").setLevel(level.upper())


def _leave(comm: Comm, code: int) -> int:
    sys.stdout.flush()
    sys.stderr.flush()
    if comm.size > 1:
        if comm.rank:
            time.sleep(TO_SPEAK)
        comm.Abort(code)
    return code


def _as_interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt
