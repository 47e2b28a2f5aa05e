"""What an interrupt must not leave behind: half-compiled forms, for which every later run would wait in vain."""

from __future__ import annotations

import traceback
from contextlib import suppress
from pathlib import Path


def forget_unfinished_form(interrupt: BaseException) -> None:
    """Remove from the cache the form whose compilation was interrupted, if one was. Not collective.

    The form compiler takes back what failed, but does not count an interrupt as a failure; the file that
    marks a compilation as begun would stay. Forms that another process is compiling are left alone.
    """
    for frame, _ in traceback.walk_tb(interrupt.__traceback__):
        here = (frame.f_globals.get("__name__"), frame.f_code.co_name)
        if here != ("ffcx.codegeneration.jit", "_compile_objects"):
            continue
        source = Path(frame.f_locals["cache_dir"]) / f"{frame.f_locals['module_name']}.c"
        if not source.with_suffix(".c.cached").exists():
            with suppress(OSError):
                source.unlink()
