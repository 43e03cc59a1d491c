"""Grids, relative dynamics, schemes, the HJI solver and value tables."""
