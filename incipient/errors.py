"""Errors that a user can remedy: one line each, with an exit code."""

import os
import re

# Control characters other than tabs and line feeds; terminals execute escape sequences.
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


class IncipientError(Exception):
    """Base of the errors that are reported in one line, without a traceback."""

    exit_code = 1


class SceneError(IncipientError):
    """An invalid or contradictory scene or other input file."""

    exit_code = 2


class MeshError(IncipientError):
    """Meshing failed."""

    exit_code = 3


class ConvergenceError(IncipientError):
    """An iteration or a factorisation failed; earlier results are kept."""

    exit_code = 4


class UnsolvedError(ConvergenceError):
    """A linear system was not solved; another state or a shorter time step may succeed."""


class OutputError(IncipientError):
    """A result could not be written or read back."""

    exit_code = 5


class MissingError(IncipientError):
    """A required module, library or compiler is not installed."""

    exit_code = 6


class Interrupted(IncipientError):
    """The run was interrupted after writing a checkpoint."""

    exit_code = 130


def refuse_broken(*rules: tuple[object, str]) -> None:
    """Raise SceneError with the message of the first rule whose condition holds."""
    for is_broken, message in rules:
        if is_broken:
            raise SceneError(message)


def refuse_path(scene: object, function: str) -> None:
    """Raise SceneError for the name of a file that is given to a public function instead of a scene."""
    if isinstance(scene, str | os.PathLike):
        why = f"incipient.{function} takes a scene, not the name of its file"
        raise SceneError(f'{why}; use incipient.load("{scene}")')


def printable(text: str) -> str:
    """The text with its control characters as escapes."""
    return CONTROL.sub(lambda match: ascii(match[0])[1:-1], text)


def shortened(said: object, most: int = 80) -> str:
    """Quotation, such as a library's error, in one line of at most `most` characters."""
    text = " ".join(str(said).split())
    return text if len(text) <= most else f"{text[: most - 3]}..."
