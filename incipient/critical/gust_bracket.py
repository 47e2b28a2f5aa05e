"""The bracket of a critical strength of gusts, and how many simulations it takes."""

from __future__ import annotations

import math

WITHIN = 0.02  # relative width of the bracket
STRONGER = 1.4  # factor by which a strength grows until the grain leaves


def runs_expected(durations: int, with_error_bars: bool) -> int:
    """About how many simulations a search for a number of durations takes."""
    each = 2 + math.ceil(math.log2(math.log(STRONGER) / math.log(1.0 + WITHIN)))
    return 1 + durations * each * (2 if with_error_bars else 1)
