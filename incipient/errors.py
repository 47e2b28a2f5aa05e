"""Errors a user can act on: one line each, with an exit code; everything else is a defect of the program."""


class IncipientError(Exception):
    """Base of all errors that are reported as one line, without a traceback."""

    exit_code = 1


class SceneError(IncipientError):
    """The scene, or another input file, asks for something wrong or contradictory."""

    exit_code = 2


class MeshError(IncipientError):
    """No usable mesh could be made of the geometry."""

    exit_code = 3


class ConvergenceError(IncipientError):
    """An iteration did not converge, or a factorisation failed; what was computed before it is kept."""

    exit_code = 4


class UnsolvedError(ConvergenceError):
    """The linear system of a state was not solved; that of another state, or of a shorter time step, may be."""


class OutputError(IncipientError):
    """A result could not be written (disk full, no permission) or read back."""

    exit_code = 5


class MissingError(IncipientError):
    """A module, a library or the compiler that the flow needs is not installed."""

    exit_code = 6


class Interrupted(IncipientError):
    """The run was interrupted; what it needs to resume has been written."""

    exit_code = 130


def shortened(said: object, most: int = 80) -> str:
    """What is quoted in an error, such as a library's words or a name from a file, in one line of so many letters."""
    text = " ".join(str(said).split())
    return text if len(text) <= most else f"{text[: most - 3]}..."
