"""Thresholds of motion: the critical flow with its error bars, critical gusts, probability of entrainment."""
