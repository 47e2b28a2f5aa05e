"""`python -m incipient.pictures.charts FILE` draws the pictures of a sweep and prints their paths as they come.

It loads neither VTK nor what else pictures of flows need, which takes longer than to draw a million cases.
"""

import argparse
import sys
from pathlib import Path

from ...errors import IncipientError
from ...installed import require_limits

parser = argparse.ArgumentParser()
parser.add_argument("file", type=Path)
for name in ("--quantity", "--against", "--by"):
    parser.add_argument(name)
options = parser.parse_args()
try:
    require_limits()  # before libraries are imported
    from .sweep import draw

    draw(
        options.file,
        lambda path: print(path, flush=True),
        options.quantity,
        options.against,
        options.by,
    )
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
