"""Synthetic runs to draw and to export."""

import os
import shutil

from browser import browser  # noqa: F401
from synthetic_runs import config, make_hostile_run, make_record, record, table  # noqa: F401

# Without a browser those tests are not collected, and tests/conftest.py says so; .ci/run insists on it.
if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
    collect_ignore_glob = ["test_*_in_browser.py"]
