"""`python -m incipient` is the command `incipient`."""

from .cli import main

raise SystemExit(main())
