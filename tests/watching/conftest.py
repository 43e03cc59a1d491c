"""A browser for the pages that show what happens; without Chromium those tests are not collected."""

import os
import shutil

from browser import browser  # noqa: F401

if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
    collect_ignore_glob = ["test_*_in_browser.py"]
