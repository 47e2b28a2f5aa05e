"""The surroundings of processes that tests start."""

import os
import sys
from pathlib import Path

from mpi4py import MPI


def environment() -> dict[str, str]:
    """One thread, and nothing of the MPI that pytest itself may run in: new ranks would look for it."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PMI_"))}
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return inherited | allowed | {"OMP_NUM_THREADS": "1"}


def on_ranks(number: int) -> list[str]:
    """The start of a command that runs on so many ranks, by the `mpirun` of the MPI that Python uses.

    PyPI's MPI brings its own beside Python; only Open MPI has to be told that there may be more ranks than cores.
    """
    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else "mpirun", "-n", str(number)]
    return [*command, "--oversubscribe"] if "Open MPI" in MPI.Get_library_version() else command
