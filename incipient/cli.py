"""The command line."""

from __future__ import annotations

import argparse
import atexit
import difflib
import gc
import logging
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from importlib import import_module, metadata
from typing import Any, NoReturn

from .commands.options import COMMANDS, RETIRED
from .errors import (
    CONTROL,
    IncipientError,
    Interrupted,
    MissingError,
    OutputError,
    SceneError,
    refuse_broken,
    shortened,
)
from .input_files import cause_of
from .installed import missing
from .interrupt import SIGNALS, comes_of_interrupt, open_streams, output_is_lost, say
from .parallel import Alone, Meeting, on_first, ranks_there_are, start_alone_quickly

DEFECT, INTERRUPTED = 70, 130
UNREAD = 128 + signal.SIGPIPE  # as of programs ended by the system because of a closed pipe
# Message of the loader of libraries without memory.
UNLOADED = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")
TO_COME = 10.0  # seconds within which other failed ranks arrive
SOON = 0.01  # seconds until an interrupt that Python could not raise comes again
TO_SPEAK = 0.5  # seconds for the first rank's message before others end the run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code, equal on all ranks."""
    open_streams()
    # A final garbage collection would take a tenth of a second without benefit.
    atexit.register(gc.freeze)
    meeting = Meeting(Alone())
    try:
        try:
            start_alone_quickly()
            meeting = Meeting(ranks_there_are())
            _refuse_words(sys.argv[1:] if arguments is None else arguments)
            code = _run(_parser().parse_args(arguments), meeting.comm)
        finally:
            sys.stdout.flush()
        meeting.failed(False)
        return code
    except SystemExit:
        raise
    except BaseException as error:
        code, words, of_all = _outcome(error, meeting.comm.rank)
        # An error that can be remedied is usually raised on all ranks: the first reports, and all exit normally.
        failed = meeting.failed(True, TO_COME) if of_all else []
        if of_all and not failed:  # others may wait for this one
            words = f"on rank {meeting.comm.rank} alone: {words}"
        if words and not (failed and meeting.comm.rank != failed.index(True)):
            say(f"incipient: {words}")
        return code if failed else _leave(meeting.comm, code)


def _outcome(error: BaseException, rank: int) -> tuple[int, str, bool]:
    """Exit code, words, if any, and whether other ranks are expected to fail as well."""
    if comes_of_interrupt(error) and not isinstance(error, Interrupted):
        words = "interrupted; what was computed so far is kept" if rank == 0 else ""
        return INTERRUPTED, words, False
    if output_is_lost(error):
        if isinstance(error, BrokenPipeError):
            return UNREAD, "", False
        words = (
            f"the standard output cannot be written ({error.strerror}); results in files are whole"
        )
        return OutputError.exit_code, words, False
    known = error if isinstance(error, IncipientError) else _known(error)
    if known is not None:
        return known.exit_code, str(known), True
    words = "".join(traceback.format_exception(error)).rstrip()
    return DEFECT, f"internal error, please report it; rank {rank}:\n{words}", False


def _known(error: BaseException) -> IncipientError | None:
    """What a user can remedy of an error of a library or the system."""
    if words := missing(error):
        return MissingError(words)
    if isinstance(error, MemoryError) or any(words in str(error) for words in UNLOADED):
        why = shortened(error) or "an allocation failed"
        return OutputError(
            f"the memory is too small ({why}); reduce the problem, or allow more memory"
        )
    if isinstance(error, OSError) and error.errno and error.filename is not None:
        remedy = "choose another name or directory, or free some space"
        return OutputError(f"{shortened(error.filename, 300)}: {cause_of(error)}; {remedy}")
    options = os.environ.get("PETSC_OPTIONS")
    if options and type(error).__module__ == "petsc4py.PETSc":
        why = f"{shortened(options)} ({shortened(str(error).splitlines()[-1])})"
        return SceneError(f"PETSc failed with PETSC_OPTIONS={why}; correct them or leave them out")
    return None


class _Parser(argparse.ArgumentParser):
    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        # Negative numbers with units, such as -2mm, are values, which are then refused as such.
        self._negative_number_matcher = re.compile(r"-\.?\d")

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
    return parser


def _refuse_words(arguments: Sequence[str]) -> None:
    name = next(iter(arguments), "")
    control = "has control characters, which terminals execute where it is printed; remove them"
    refuse_broken(
        (name in RETIRED, f"{name}: is retired; {RETIRED.get(name)}"),
        *((CONTROL.search(word), f"{shortened(word)}: {control}") for word in arguments),
    )


def _run(chosen: argparse.Namespace, comm: Any) -> int:
    name = chosen.command
    _listen(chosen.log_level)
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    sys.unraisablehook = interrupt_again
    COMMANDS[name].check(chosen)
    function = getattr(import_module(f".commands.{COMMANDS[name].module}", __package__), name)
    if not COMMANDS[name].on_first:
        return int(function(chosen, comm))
    on_first(comm, function, chosen)
    return 0


def _listen(level: str) -> None:
    shown = logging.StreamHandler(sys.stderr)
    # The root logger's level is changed by the compilation of forms, which logs at level info.
    shown.addFilter(
        lambda record: record.levelno >= logging.WARNING or record.name.startswith("incipient")
    )
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[shown])
    logging.getLogger("incipient").setLevel(level.upper())


def _leave(comm: Any, code: int) -> int:
    sys.stdout.flush()
    sys.stderr.flush()
    if comm.size > 1:
        if comm.rank:
            time.sleep(TO_SPEAK)
        comm.Abort(code)
    return code


def interrupt_again(lost: sys.UnraisableHookArgs) -> None:
    """Interrupt once more after an interrupt within a finalizer, where Python cannot raise it."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        threading.Timer(SOON, signal.raise_signal, [signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(lost)
