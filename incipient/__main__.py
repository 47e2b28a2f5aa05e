"""The command `incipient` as a process."""

import os
import signal
import sys

from .errors import OutputError


def main() -> int:
    """Run the command line; returns the exit code."""
    ends = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # otherwise it is ignored
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
    except KeyboardInterrupt:  # a second interrupt, while the first is reported
        return 128 + signal.SIGINT
    finally:
        if ends:
            signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: object) -> None:
    """End at once: imports would convert an exception, and clean-ups would print it."""
    os._exit(128 + number)


if __name__ == "__main__":
    raise SystemExit(main())
