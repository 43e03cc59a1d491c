"""Synthetic runs to draw and to export."""

import os
import shutil

from synthetic_runs import config, make_hostile_run, make_record, record, table  # noqa: F401

# Without a browser that test is not collected, and tests/conftest.py says so; .ci/run insists on it.
if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
    collect_ignore = ["test_report_in_browser.py"]
