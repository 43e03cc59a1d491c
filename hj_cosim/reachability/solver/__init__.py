"""The level-set solver: from V(0, ·) to V(−horizon, ·)."""
