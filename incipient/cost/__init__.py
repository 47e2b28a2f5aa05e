"""Cost of accuracy: a ladder of runs, their errors, and the frontier of error against CPU time."""
