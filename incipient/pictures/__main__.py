"""`python -m incipient.pictures OPTIONS` draws pictures of results or a sweep, or an animation; options are JSON."""

import json
import sys
from functools import partial
from pathlib import Path

from ..errors import IncipientError
from ..installed import require_limits

options = json.loads(sys.argv[1])
path = Path(options.pop("path"))
announce = partial(print, flush=True)

try:
    require_limits()  # before libraries are imported
    if "field" in options:
        from .film import animate

        target = options["target"] and Path(options["target"])
        announce(animate(path, target, options["field"]))
    elif path.is_file():
        from . import sweep

        sweep.draw(path, announce, **options)
    else:
        from . import directory_pictures

        directory_pictures.draw(path, announce)
except IncipientError as error:
    print(error, file=sys.stderr)
    raise SystemExit(error.exit_code) from None
