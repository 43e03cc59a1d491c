"""One episode: its configuration and the loop that drives it."""
