"""Checkpoints: written, read and restored on any number of ranks."""
