"""The environment of a process of one rank."""

from __future__ import annotations

import os

# What would make a new process take part in a parallel run, or an `mpirun` spread over the machines of Slurm's job.
PARALLEL = (
    *("OMPI_COMM_", "OMPI_UNIVERSE", "OMPI_MCA_orte_", "OMPI_MCA_ess", "OMPI_MCA_pmix"),
    *("OMPI_FILE_", "OMPI_APP_", "OMPI_FIRST_RANKS", "OMPI_NUM_APP_CTX", "PMIX_", "PMI_"),
    *("ORTE_", "PRTE_", "SLURM_"),
)


def environment_of_one_rank() -> dict[str, str]:
    """The environment of a run alone: one thread, no MPI variables, fixed hash seed (stable form cache)."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(PARALLEL)}
    # A form's signature may depend on the order of a set: fixed, or forms would be compiled again.
    return {**kept, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
