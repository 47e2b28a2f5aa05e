"""A grain that moves in the flow, freely or on a prescribed way."""
