"""Entrainment by a fluctuating stream: probability of motion at an instant, rate per unit of time, Shields numbers."""
