"""Many episodes: stacks, statistics, tables."""
