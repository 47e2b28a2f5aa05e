"""Many loads on one grain and its contacts: series, directions, errors and their probabilities."""
