"""Error estimates and error bars of a result."""
