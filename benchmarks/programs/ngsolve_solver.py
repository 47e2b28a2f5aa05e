"""The fastest direct solver for saddle points that NGSolve offers here."""

from importlib.metadata import PackageNotFoundError, version


def _offered() -> str:
    """Pardiso where Intel's MKL is installed beside NGSolve, else UMFPACK, which its wheel brings."""
    try:
        version("mkl")
    except PackageNotFoundError:
        return "umfpack"
    return "pardiso"


INVERSE = _offered()
