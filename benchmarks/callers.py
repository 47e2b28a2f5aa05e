"""How the compared programs are called: incipient, NGSolve in its own environment."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from measure import ROOT, Program, Session, last_line

INCIPIENT, NGSOLVE = "incipient", "NGSolve"
SCRIPTS = Path("benchmarks/programs")
NGSOLVE_ENVIRONMENT = ROOT / ".bench-venv"
Settings = dict[str, Any]


def incipient(
    session: Session, scene: str, name: str, settings: Settings, prefix: tuple[str, ...] = ()
) -> Program:
    """`incipient run` of a scene of the demos with some of its keys set; no pictures, and no error bars unless set."""
    directory = session.directory()
    words = [*prefix, command("incipient"), "run", f"demos/scenes/{scene}.toml"]
    for key, value in {"output.pictures": False, "numerics.error_bars": False, **settings}.items():
        words += ["--set", f"{key}={json.dumps(value)}"]
    words += ["--out", str(directory)]
    return Program(
        name, INCIPIENT, tuple(words), lambda usage: read_result(directory), {"settings": settings}
    )


def read_result(directory: Path) -> dict[str, Any]:
    """The numbers of a result.json that benchmarks are about."""
    result = json.loads((directory / "result.json").read_text())
    numbers: dict[str, Any] = {"directory": str(directory)}
    for section in ("coefficients", "centrelines", "gap"):
        if result[section]:
            numbers[section] = result[section]
    if result["force"]:
        numbers["force"] = result["force"]["flow"]
        numbers["couple"] = result["torque"]["flow"][2]
    cost = result["cost"]
    numbers |= {key: cost[key] for key in ("unknowns", "cells", "iterations")}
    numbers |= {"stages": cost["wall_time"], "all_ranks_mib": cost["peak_memory_mib"]}
    return numbers


def ngsolve(script: str, name: str, *arguments: Any) -> Program:
    """An NGSolve script, run by the interpreter of NGSolve's environment."""
    python = NGSOLVE_ENVIRONMENT / "bin/python"
    return Program(
        name, NGSOLVE, (str(python), str(SCRIPTS / f"{script}.py"), *map(str, arguments)), last_line
    )


def script(name: str, file: str, *arguments: Any) -> Program:
    """A script of the benchmarks, run in the project's own environment."""
    return Program(name, INCIPIENT, (sys.executable, file, *map(str, arguments)), last_line)


def prepare_ngsolve(session: Session) -> str:
    """Make NGSolve's environment if it is not there; returns its version, or "" if it is not to be had."""
    if version := _ngsolve_version():
        return version
    session.say("installing NGSolve from PyPI into .bench-venv")
    python = str(NGSOLVE_ENVIRONMENT / "bin/python")
    try:
        subprocess.run(["/usr/bin/python3", "-m", "venv", str(NGSOLVE_ENVIRONMENT)], check=True)
        # MKL brings NGSolve the faster of its direct solvers.
        subprocess.run([python, "-m", "pip", "install", "-q", "ngsolve", "mkl"], check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        session.say(f"NGSolve is not to be had, going on without: {error}")
    return _ngsolve_version()


def _ngsolve_version() -> str:
    asked = "from importlib.metadata import version; import ngsolve; print(version('ngsolve'))"
    words = [str(NGSOLVE_ENVIRONMENT / "bin/python"), "-c", asked]
    try:
        return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def command(name: str) -> str:
    """Path of a command installed beside the interpreter that runs the benchmarks."""
    return str(Path(sys.executable).parent / name)
