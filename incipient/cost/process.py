"""A process of one rank, measured from outside: wall time, processor time, peak memory, and its output."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

# What would make a new process take part in a parallel run, or an `mpirun` spread over the machines of Slurm's job.
PARALLEL = (
    *(
        "OMPI_COMM_",
        "OMPI_UNIVERSE",
        "OMPI_MCA_orte_",
        "OMPI_MCA_ess",
        "OMPI_MCA_pmix",
        "OMPI_FILE_",
        "OMPI_APP_",
    ),
    *("OMPI_FIRST_RANKS", "OMPI_NUM_APP_CTX", "PMIX_", "PMI_", "ORTE_", "PRTE_", "SLURM_"),
)


def environment_of_one_rank(options: str = "") -> dict[str, str]:
    """The environment of a run alone: one thread, no MPI variables, fixed hash seed (stable form cache).

    `options` of PETSc come after those that the environment has.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith(PARALLEL)}
    if options:
        kept["PETSC_OPTIONS"] = f"{kept.get('PETSC_OPTIONS', '')} {options}".strip()
    # A form's signature may depend on the order of a set: fixed, or forms would be compiled again.
    return {**kept, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


@dataclass(frozen=True)
class Usage:
    """Cost and output of one process: seconds, MiB of its largest process; a negative exit code is a signal's."""

    wall: float
    cpu: float
    peak_mib: float
    exit_code: int
    output: str
    errors: str


def run(
    command: Sequence[str],
    environment: Mapping[str, str] | None = None,
    directory: Path | None = None,
    given: str = "",
    apart: bool = False,
) -> Usage:
    """Run a command to its end; if that is not waited for, it is killed. Not collective.

    The kernel counts the peak of a new process from that of the one that starts it: it is that of the command only
    where the caller is the smaller one.

    Args:
        environment: its variables; None: those of this process.
        directory: where it works; None: here.
        given: what it reads from its standard input.
        apart: in a session of its own, so that keys pressed for this process do not reach it.
    """
    with (
        tempfile.TemporaryFile("w+") as text,
        tempfile.TemporaryFile("w+") as output,
        tempfile.TemporaryFile("w+") as errors,
    ):
        text.write(given)
        text.seek(0)
        began = time.perf_counter()
        process = subprocess.Popen(
            command,
            stdin=text,
            stdout=output,
            stderr=errors,
            cwd=directory,
            env=environment,
            start_new_session=apart,
        )
        try:
            _, status, used = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            process.wait()
            raise
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        cpu, peak = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
        return Usage(wall, cpu, peak, process.returncode, output.read(), errors.read())
