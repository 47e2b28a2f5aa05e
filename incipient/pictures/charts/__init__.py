"""Charts: what accuracy costs, quantities of sweeps."""
