"""A bed of many grains: contacts and pockets, loads on some grains, and the distribution of thresholds."""
