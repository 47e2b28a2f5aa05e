"""The surroundings of processes that tests start."""

import os


def environment() -> dict[str, str]:
    """One thread, and nothing of the MPI that pytest itself may run in: new ranks would look for it."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PMI_"))}
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return inherited | allowed | {"OMP_NUM_THREADS": "1"}
