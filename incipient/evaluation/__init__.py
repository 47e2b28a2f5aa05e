"""From loads and contacts to verdicts and numbers in SI units, which `results` holds as data."""
