"""Solved tables: kept in files, asked for values, gradients and optimal inputs."""
