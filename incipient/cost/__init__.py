"""What accuracy costs in time: a ladder of runs, their errors, and the frontier of error against time."""
