"""A bed of many grains: its contacts and pockets, the loads on some of its grains, and thresholds as a distribution."""
