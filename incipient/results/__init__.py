"""Results of a run as data: loads, verdict, error bars, timing."""
