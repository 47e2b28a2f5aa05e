"""What accuracy costs in time: ladders of runs and their law, this machine's calibration, and predictions from it."""
