"""`python -m incipient.pictures DIR` draws the pictures of its results and prints their paths as they come.

With `--animate --field NAME` it makes the one animation instead, with `--out FILE` under another than the usual name.
"""

import argparse
import sys
from pathlib import Path

from ..errors import IncipientError
from ..installed import require_limits

parser = argparse.ArgumentParser()
parser.add_argument("directory", type=Path)
parser.add_argument("--animate", action="store_true")
parser.add_argument("--out", type=Path)
parser.add_argument("--field", default="velocity")
options = parser.parse_args()
try:
    require_limits()  # before libraries are imported
    if options.animate:
        from .film import animate

        print(animate(options.directory, options.out, options.field))
    else:
        from .directory_pictures import draw

        draw(options.directory, lambda path: print(path, flush=True))
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
