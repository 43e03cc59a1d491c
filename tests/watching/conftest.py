"""A browser for the pages that show what happens; without Chromium those tests are not collected."""

import os
import shutil
from collections.abc import Iterator

import pytest
from browser import Browser

if shutil.which("chromium") is None and "HJ_COSIM_REQUIRE_BROWSER" not in os.environ:
    collect_ignore_glob = ["test_*_in_browser.py"]


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    browser = Browser(tmp_path_factory.mktemp("chromium"))
    yield browser
    browser.close()
