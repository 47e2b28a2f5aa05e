"""The command `incipient` as a process: interrupts and a shortage of memory are one line from its start to its end."""

import os
import signal
import sys

from .errors import OutputError


def main() -> int:
    """Do what the command line says and return the exit code."""
    ends = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored
    if ends:
        signal.signal(signal.SIGINT, _end)
    try:
        from .installed import require_limits

        require_limits()
        from .cli import main as command

        return command()
    except OutputError as error:
        print(f"incipient: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:  # once more, while the first is reported
        return 128 + signal.SIGINT
    finally:
        if ends:
            signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: object) -> None:
    """End this process: while libraries are imported or cleaned up there is nothing to keep.

    Imports would turn an exception into one of their own, and clean-ups print it.
    """
    os._exit(128 + number)


if __name__ == "__main__":
    raise SystemExit(main())
