"""How accurate a result is, and how to reach an accuracy asked for: error estimates, error bars, adaptive runs."""
