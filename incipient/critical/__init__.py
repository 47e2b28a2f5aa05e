"""The critical flow of a scene: the load as the flow grows from rest, the search for where it moves the grain, errors."""
