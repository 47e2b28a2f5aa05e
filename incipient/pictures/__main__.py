"""`python -m incipient.pictures DIR` draws the pictures of its results and prints their paths, one a line."""

import sys
from pathlib import Path

from ..errors import IncipientError
from . import draw

try:
    print(*draw(Path(sys.argv[1])), sep="\n")
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
