"""Large tables spread over ranks, in memory and in files; known to all floors."""
