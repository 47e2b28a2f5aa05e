"""`python -m incipient.pictures DIR` draws the pictures of its results and prints their paths, one a line.

With `--animate FILE --field NAME` it makes the one animation instead; an empty FILE stands for the usual name.
"""

import argparse
import sys
from pathlib import Path

from ..errors import IncipientError
from . import draw

parser = argparse.ArgumentParser()
parser.add_argument("directory", type=Path)
parser.add_argument("--animate")
parser.add_argument("--field", default="velocity")
options = parser.parse_args()
try:
    if options.animate is None:
        print(*draw(options.directory), sep="\n")
    else:
        from .animation import animate

        print(animate(options.directory, Path(options.animate) if options.animate else None, options.field))
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
