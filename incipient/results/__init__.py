"""What a run gives back, as data: loads, verdict, error bars, timing."""
