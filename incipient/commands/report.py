"""`incipient report`: one HTML page of results."""

from __future__ import annotations

import argparse

import incipient

from ..parallel import Comm, collectively


def report(options: argparse.Namespace, comm: Comm) -> int:
    """Write the page and say where it is."""
    with collectively(comm):
        if comm.rank == 0:
            print(incipient.report(options.path, options.out), flush=True)
    return 0
