"""`incipient show` and `incipient report`."""

from __future__ import annotations

import argparse

import incipient

from ..errors import OutputError, SceneError
from ..pictures.apart import Drawn, animate_apart, draw_apart, draw_sweep_apart
from ..results.kinds import KINDS
from .options import OF_SWEEPS, require_left_by

RECORDS = (*(kind.record for kind in KINDS), "scene.toml")


def show(options: argparse.Namespace) -> None:
    """Draw or animate results."""
    if options.directory.suffix == ".toml":
        remedy = "run it, then give the directory of the results"
        raise SceneError(f"{options.directory}: is a scene, not results; {remedy}")
    if options.directory.is_file():
        _show_sweep(options)
        return
    for name in OF_SWEEPS:
        if getattr(options, name) is not None:
            raise SceneError(
                f"--{name} applies to the file of a sweep; leave it out for {options.directory}"
            )
    require_left_by(options.directory, RECORDS)
    if options.animate:
        print(animate_apart(options.directory, options.out, options.field or "velocity"))
    else:
        _name(draw_apart(options.directory))


def _name(drawn: Drawn) -> None:
    for path in drawn.paths:
        print(path)
    if drawn.complaint:
        raise OutputError(drawn.complaint)


def _show_sweep(options: argparse.Namespace) -> None:
    if options.animate:
        why = "is the file of a sweep, which is not animated"
        raise SceneError(f"{options.directory}: {why}; leave the option out")
    asked = {name: getattr(options, name) for name in OF_SWEEPS}
    _name(draw_sweep_apart(options.directory, **asked))


def report(options: argparse.Namespace) -> None:
    """Write the page of results and print its path."""
    print(incipient.report(options.path, options.out), flush=True)
