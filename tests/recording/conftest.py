"""Synthetic runs to write and to read."""

from synthetic_runs import config, make_hostile_run, make_record, record, table  # noqa: F401
