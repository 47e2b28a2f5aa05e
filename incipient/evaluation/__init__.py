"""Verdicts from loads and contacts."""
