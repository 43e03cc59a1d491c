"""Figures, replays, reports and exports, made from what was recorded."""
