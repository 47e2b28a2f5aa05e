"""Processes that tests start: their surroundings, and their end."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI


def environment() -> dict[str, str]:
    """One thread, and nothing of the MPI that pytest itself may run in: new ranks would look for it.

    Processes keep the bytecode of modules, as a user's do: to compile the package takes a tenth of a short run.
    Ranks that wait let others have the processor: on a busy machine Open MPI's else take several times as long.
    """
    own = ("OMPI_", "PMIX_", "PMI_", "PYTHONDONTWRITEBYTECODE")
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(own)}
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return inherited | allowed | {"OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}


def on_ranks(number: int) -> list[str]:
    """The start of a command that runs on so many ranks, by the `mpirun` of the MPI that Python uses.

    PyPI's MPI brings its own beside Python; only Open MPI has to be told that there may be more ranks than cores, and
    not to tie ranks to cores, the same ones for every `mpirun`: two side by side would share them.
    """
    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else "mpirun", "-n", str(number)]
    return (
        [*command, "--oversubscribe", "--bind-to", "none"]
        if "Open MPI" in MPI.Get_library_version()
        else command
    )


def finished(
    command: Sequence[object], timeout: float, code: int | None = 0, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, with its text output, and leave nothing of it behind, whatever happens.

    Fails with what it complained of if its exit code is another; None: any will do.
    Raises `subprocess.TimeoutExpired` when the time is up.
    """
    process = subprocess.Popen(
        [str(part) for part in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )
    try:
        said, complained = process.communicate(timeout=timeout)
    except BaseException:
        end(process)
        raise
    end_session(process.pid)
    assert code is None or process.returncode == code, complained
    return subprocess.CompletedProcess(command, process.returncode, said, complained)


def end(process: subprocess.Popen[str]) -> None:
    """Kill a process that leads a session, and all that belong to it."""
    end_session(process.pid)
    process.communicate()


def end_session(leader: int) -> None:
    """Kill all processes of a session: ranks outlive a killed `mpirun`, which gives each a process group of its own."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[3]) == leader:
                os.kill(int(stat.parent.name), signal.SIGKILL)


def grids(stem: Path) -> dict[float, Any]:
    """Grids by time of a series of fields, as VTK, and with it ParaView, reads them."""
    pyvista = pytest.importorskip("pyvista")
    reader, result = pyvista.get_reader(f"{stem}.xdmf"), {}
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grid = reader.read()
        result[time] = grid[0] if isinstance(grid, pyvista.MultiBlock) else grid
    return result
