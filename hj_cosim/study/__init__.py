"""Many episodes: the paper's table, with intervals, on one machine or on a cluster."""
