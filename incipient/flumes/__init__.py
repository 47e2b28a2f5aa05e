"""Whether a bed of grains moves in a flume, from stored and published thresholds, without a flow."""

from .answer import FlumeAnswer, flume

__all__ = ["FlumeAnswer", "flume"]
