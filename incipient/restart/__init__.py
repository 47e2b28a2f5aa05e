"""Checkpoints: all that a run needs to resume, written, read and put back on any number of ranks."""
