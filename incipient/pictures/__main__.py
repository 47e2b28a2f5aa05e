"""`python -m incipient.pictures PATH` draws pictures of results or a sweep, or an animation."""

import argparse
import sys
from pathlib import Path

from ..errors import IncipientError
from ..installed import require_limits

parser = argparse.ArgumentParser()
parser.add_argument("path", type=Path)
parser.add_argument("--animate", action="store_true")
parser.add_argument("--out", type=Path)
parser.add_argument("--field", default="velocity")
for name in ("--quantity", "--against", "--by"):
    parser.add_argument(name)
options = parser.parse_args()


def announce(path: Path) -> None:
    """Print the path of a picture."""
    print(path, flush=True)


try:
    require_limits()  # before libraries are imported
    if options.animate:
        from .film import animate

        announce(animate(options.path, options.out, options.field))
    elif options.path.is_file():
        from .charts import sweep

        sweep.draw(options.path, announce, options.quantity, options.against, options.by)
    else:
        from . import directory_pictures

        directory_pictures.draw(options.path, announce)
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
