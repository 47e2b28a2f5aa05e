"""Checkpoints: all that a run needs to go on, written, read and put back on any number of ranks."""
