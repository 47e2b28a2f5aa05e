"""The critical flow of a scene: the load as the flow grows from rest, where it moves the grain, and error bars."""
