"""Pictures of runs, studies and the value function; matplotlib is imported here and nowhere else."""
