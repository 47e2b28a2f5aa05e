"""Requirements of flow computations: packages, libraries, memory and limits of the shell."""

from __future__ import annotations

import ctypes
import mmap
import os
import re
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from .errors import MissingError, OutputError

# Modules that `pip install incipient` does not install.
MODULES = ("mpi4py", "petsc4py", "dolfinx", "ufl", "basix", "ffcx", "gmsh", "h5py")
MODULES_REMEDY = (
    "on Debian run apt-get install python3-dolfinx python3-gmsh python3-h5py, elsewhere, with Python 3.12 or newer, "
    "pip install 'incipient[dolfinx]'"
)
# System requirements of packages from PyPI: gmsh, VTK, and compilation of forms by dolfinx.
LIBRARIES = "libglu1-mesa libgl1 libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1 libegl1 libgl1-mesa-dri"
COMPILER = "gcc libc6-dev python3-dev"
SYSTEM_REMEDY = f"on Debian run apt-get install {LIBRARIES} {COMPILER}"
# Memory [MiB] of Python with all libraries and a small mesh, by version of dolfinx; checked by
# tests/unit/test_meshing_in_space.py.
MEMORY = {"0.5": 186.0, "0.9": 280.0}
NEWEST = "0.9"  # of those, used for versions not listed
DISTRIBUTIONS = ("fenics-dolfinx", "dolfinx-solver-real")

# Address space [MiB] of numpy's first matrix product and of a scene, without which pydantic aborts, and a tenth more:
# VmPeak of `a @ a; incipient.load(scene)` less that of Python is 213. 128 of it are a buffer of OpenBLAS 0.3.21, which
# retries for ever if mapping fails.
OF_SCENES = 235
# Least limits of `ulimit`. Measured: a sweep with two workers opens 24 files; meshing and MUMPS crash with a stack of
# 512 KiB, and run with 700.
LEAST = {"-n": (resource.RLIMIT_NOFILE, 1, 64), "-s": (resource.RLIMIT_STACK, 1024, 1024)}


def memory_of_libraries() -> float:
    """Memory [MiB] of a run before its flow, by version of dolfinx, without importing it."""
    for name in DISTRIBUTIONS:
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
        return MEMORY.get(".".join(version.split(".")[:2]), MEMORY[NEWEST])
    return MEMORY[NEWEST]


def free_bytes() -> float:
    """Memory available to this process, on its machine or in its container; the page cache counts as free."""
    import psutil

    free = psutil.virtual_memory().available
    with suppress(OSError, ValueError):
        groups = Path("/sys/fs/cgroup")
        most, used = (int((groups / name).read_text()) for name in ("memory.max", "memory.current"))
        free = min(free, most - used)
    return float(free)


@cache
def require_limits() -> None:
    """Raise OutputError for limits of the shell with which libraries abort, crash or hang.

    Under a limit of memory OpenBLAS maps its buffer now, before other libraries take the address space.
    """
    for option, (kind, unit, least) in LEAST.items():
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY and limit < least * unit:
            raise OutputError(
                f"ulimit {option} is {limit // unit}, too small for the libraries; set it to {least} or more"
            )
    limits = (resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA))
    if all(limit == resource.RLIM_INFINITY for limit in limits):
        return
    try:
        mmap.mmap(-1, OF_SCENES * 2**20, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()
        import numpy as np

        np.ones((256, 256)) @ np.ones((256, 256))
    except (OSError, MemoryError, ImportError) as error:
        raise OutputError(
            f"the memory is too small: ulimit -v or -d leave less than {OF_SCENES} MiB for a scene alone; "
            "allow 1 GiB or more"
        ) from error


def require_directories() -> None:
    """Raise OutputError for unusable working or temporary directories, with which Open MPI fails obscurely."""
    try:
        Path.cwd()
    except OSError as error:
        raise OutputError("the working directory has been removed; change to another") from error
    names = ("TMPDIR", "TEMP", "TMP")
    name = next((name for name in names if os.environ.get(name)), None)
    directory = Path(os.environ[name] if name else "/tmp")
    probe = directory / f"incipient.{os.getpid()}"
    try:
        probe.mkdir()
        probe.rmdir()
    except OSError as error:
        said, why = f"{name}={directory}" if name else directory, error.strerror
        raise OutputError(
            f"{said}: temporary files cannot be written there ({why}); "
            f"set {name or names[0]} to a directory that can be written"
        ) from error


def return_freed_memory() -> None:
    """Return memory to the system; glibc retains gigabytes after approximate LU factorisations."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def optional(module: str, extra: str, called: str = "") -> Any:
    """The library of a module that an extra installs, with that module. Raises MissingError."""
    name = module.partition(".")[0]
    try:
        import_module(module)
        return import_module(name)
    except ImportError as error:
        raise MissingError(
            f"{called or name} cannot be used ({error}): pip install 'incipient[{extra}]'"
        ) from None


def missing(error: BaseException) -> str | None:
    """Missing part named by an error, with its remedy, in one line, or None."""
    if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] in MODULES:
        return f"{(error.name or '').partition('.')[0]} is not installed: {MODULES_REMEDY}"
    return missing_in_words(str(error))


def missing_in_words(words: str) -> str | None:
    """Missing part named in a message, with its remedy, in one line, or None."""
    library = re.search(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object file", words)
    if library:
        return f"the library {library[1]} is not installed: {SYSTEM_REMEDY}"
    if "cannot load MPI library" in words:
        return f"there is no MPI library: {MODULES_REMEDY}"
    # The latter are messages of other ranks after a failed compilation on the first, by version of dolfinx.
    failed = re.search(
        r"CompileError.*|Compilation failed on root node|JIT compilation failed on rank 0", words
    )
    if failed:
        return f"a form was not compiled: it needs a C compiler and Python's headers ({failed[0]}): {SYSTEM_REMEDY}"
    return None


@contextmanager
def required() -> Iterator[None]:
    """Convert errors because of a missing module, library or compiler in the block to MissingError."""
    try:
        yield
    except Exception as error:
        words = missing(error)
        if words is None:
            raise
        raise MissingError(words) from error


@contextmanager
def arguments_of_text() -> Iterator[None]:
    """Allow file names outside UTF-8 on the command line, which dolfinx and PETSc read."""
    before = sys.argv
    sys.argv = [os.fsencode(argument).decode(errors="replace") for argument in before]
    try:
        yield
    finally:
        sys.argv = before


@contextmanager
def versions_without_setuptools() -> Iterator[None]:
    """Provide versions to ufl and ffcx of 2022 without setuptools, whose import takes 80 ms."""
    from importlib.metadata import distribution

    stand_in: Any = ModuleType("pkg_resources")
    stand_in.get_distribution = distribution
    known = sys.modules.setdefault("pkg_resources", stand_in)
    try:
        yield
    finally:
        if known is stand_in:
            del sys.modules["pkg_resources"]
