"""Pictures of runs, studies and the value function; matplotlib and pandas are imported here and nowhere else."""
