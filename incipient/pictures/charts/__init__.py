"""Charts of studies of cost, searches, sweeps and surveys."""
