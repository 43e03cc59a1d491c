"""Threat metrics, summaries, figures and exports."""
