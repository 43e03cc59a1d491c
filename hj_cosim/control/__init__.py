"""The tracking controller and the safety filters."""
