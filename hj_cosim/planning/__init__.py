"""Optimistic planning with and without the HJI reward."""
