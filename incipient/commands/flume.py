"""`incipient flume`: motion of a bed of grains, from stored and published thresholds."""

from __future__ import annotations

import argparse
import json
import re
import sys
from shlex import quote

from ..errors import SceneError
from ..files import write_new
from ..flumes import flume as answer_of
from ..flumes.answer import RANGES, FlumeAnswer
from ..scene.units import METRES

_LENGTH = re.compile(r"([-+0-9.eE]+)\s*([a-z]*)")
FLOW = ("shear_velocity", "depth", "velocity", "slope")
FLUID = ("temperature", "viscosity", "fluid_density", "gravity")
NUMBERS = re.compile(rf"\b({'|'.join(RANGES)})\b")


def length(text: str) -> float:
    """A length [m] from text such as 2mm, 0.3m or 0.002."""
    parts = _LENGTH.fullmatch(text.strip())
    unit = (parts and parts[2]) or "m"
    try:
        return float(parts[1] if parts else text) * METRES[unit]
    except (KeyError, ValueError):
        units = ", ".join(METRES)
        raise argparse.ArgumentTypeError(
            f'"{text}" is not a length; give a number and one of {units}, as in 2mm'
        ) from None


def flume(options: argparse.Namespace) -> None:
    """Print the answer; write the requested scene and picture."""
    known = {name: getattr(options, name) for name in (*FLOW, *FLUID)}
    try:
        answer = answer_of(options.diameter, options.density, **known)
    except SceneError as error:
        message = NUMBERS.sub(lambda number: f"--{number[0].replace('_', '-')}", str(error))
        raise SceneError(message) from None
    print(json.dumps(answer.as_dict(), indent=2) if options.json else answer.text())
    _write(options, answer)


def _write(options: argparse.Namespace, answer: FlumeAnswer) -> None:
    # JSON stands alone on the standard output.
    stream = sys.stderr if options.json else sys.stdout
    if options.scene is not None:
        from ..flumes.answer import flume_scene
        from ..planning.plan import make_plan
        from ..scene import loads

        text = flume_scene(answer)
        write_new(options.scene, text)
        words = [
            f"{options.scene}: a scene of one such grain; next: incipient run {quote(str(options.scene))}",
            *(f"warning: {warning}" for warning in make_plan(loads(text)).warnings),
        ]
        print("\n".join(words), file=stream)
    if options.curve is not None:
        from ..pictures.sweep import draw_flume

        draw_flume(answer, options.curve)
        print(options.curve, file=stream)
