"""Thresholds of motion: critical flow, critical gusts, probability of entrainment."""
