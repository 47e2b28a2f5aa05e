"""Verdicts and numbers in SI units from loads and contacts, which `results` holds as data."""
