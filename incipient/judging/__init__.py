"""Verdicts on forces and contacts from measurements and other programs."""
