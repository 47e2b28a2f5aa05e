"""How the compared programs are called: incipient, NGSolve in its own environment."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from measure import Program, Session, last_line, measure, say
from tables import ROOT, Row

INCIPIENT, NGSOLVE = "incipient", "NGSolve"
SCRIPTS = "benchmarks/programs"
NGSOLVE_ENVIRONMENT = ROOT / ".bench-venv"
NGSOLVE_PYTHON = NGSOLVE_ENVIRONMENT / "bin/python"
# MKL brings NGSolve the faster of its direct solvers.
INSTALL = f"/usr/bin/python3 -m venv {NGSOLVE_ENVIRONMENT} && {NGSOLVE_PYTHON} -m pip install -q ngsolve mkl"
VERSION = "from importlib.metadata import version; import ngsolve; print(version('ngsolve'))"
Settings = Mapping[str, Any]


def command(task: str, scene: Path | str, settings: Settings, *options: object) -> tuple[str, ...]:
    """`incipient TASK` on a scene with some of its keys set, as words."""
    words = [sys.executable, "-m", "incipient", task, str(scene), *map(str, options)]
    for key, value in settings.items():
        words += ["--set", f"{key}={json.dumps(value)}"]
    return tuple(words)


def read_result(directory: Path) -> Row:
    """The numbers of a result.json that benchmarks are about."""
    result = json.loads((directory / "result.json").read_text())
    numbers = {
        section: result[section]
        for section in ("coefficients", "centrelines", "gap")
        if result[section]
    }
    if result["force"]:
        numbers["force"] = result["force"]["flow"]
        numbers["couple"] = result["torque"]["flow"][2]
    cost = result["cost"]
    numbers |= {key: cost[key] for key in ("unknowns", "cells", "iterations")}
    return numbers | {"stages": cost["wall_time"], "all_ranks_mib": cost["peak_memory_mib"]}


def incipient(
    session: Session,
    scene: str,
    name: str,
    settings: Settings,
    prefix: tuple[str, ...] = (),
    read: Callable[[Path], Row] = read_result,
) -> Program:
    """`incipient run` of a scene of the demos with some of its keys set; no pictures, and no error bars unless set."""
    directory = session.directory()
    keys = {"output.pictures": False, "numerics.error_bars": False, **settings}
    words = command("run", f"demos/scenes/{scene}.toml", keys, "--out", directory)
    about = {"settings": dict(settings)}
    return Program(name, INCIPIENT, prefix + words, lambda usage: read(directory), about)


def ngsolve(script: str, name: str, *arguments: Any) -> Program:
    """An NGSolve script, run by the interpreter of NGSolve's environment."""
    words = (str(NGSOLVE_PYTHON), f"{SCRIPTS}/{script}.py", *map(str, arguments))
    return Program(name, NGSOLVE, words, last_line)


def script(name: str, file: str, *arguments: Any) -> Program:
    """A script of the benchmarks, run in the project's own environment."""
    words = (sys.executable, f"{SCRIPTS}/{file}.py", *map(str, arguments))
    return Program(name, INCIPIENT, words, last_line)


@cache
def ngsolve_version() -> str:
    """NGSolve's version, its environment made if it is not there; "" if it is not to be had."""
    question = ["sh", "-c", f'{NGSOLVE_PYTHON} -c "{VERSION}"']
    if measure(question).exit_code != 0:
        say("installing NGSolve from PyPI into .bench-venv, or going on without")
        measure(["sh", "-c", INSTALL])
    return measure(question).output.strip()
