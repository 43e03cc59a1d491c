"""The road frame, and what stands and moves in it at one instant."""
