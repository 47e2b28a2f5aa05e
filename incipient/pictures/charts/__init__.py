"""Charts of studies of cost, sweeps, surveys and series."""
