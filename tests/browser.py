"""A real headless Chromium, driven through its debugging pipe, for the tests of the pages."""

import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync --disable-dev-shm-usage --hide-scrollbars --remote-debugging-pipe"
)
PATIENCE = 60.0  # s, what a slow machine may need for an answer


class Browser:
    """One tab of Chromium, spoken to in the DevTools protocol: JSON messages that end in a zero byte."""

    def __init__(self, profile: Path) -> None:
        assert CHROMIUM is not None, "HJ_COSIM_REQUIRE_BROWSER is set, but there is no chromium: install Debian's"
        to_browser, self._output = os.pipe()
        self._input, from_browser = os.pipe()
        os.set_blocking(self._input, False)
        # Chromium reads from descriptor 3 and writes to 4; duplicates above both cannot be overwritten on the way.
        reading, writing = (fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_browser, from_browser))
        self._process = subprocess.Popen(
            [CHROMIUM, *FLAGS.split(), f"--user-data-dir={profile}", "--window-size=1120,900", "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(3, 4),
            preexec_fn=lambda: (os.dup2(reading, 3), os.dup2(writing, 4)),
        )
        for end in (to_browser, from_browser, reading, writing):
            os.close(end)
        self._sent = 0
        self._unread = b""
        self._session: str | None = None
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Return the result of a command; what happens meanwhile is added to `events`."""
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._output, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._sent:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _next(self) -> dict[str, Any]:
        until = time.monotonic() + PATIENCE
        while b"\0" not in self._unread:
            assert self._process.poll() is None, "Chromium ended"
            assert time.monotonic() < until, "Chromium does not answer"
            try:
                self._unread += os.read(self._input, 1 << 20)
            except BlockingIOError:
                time.sleep(0.005)
        message, self._unread = self._unread.split(b"\0", 1)
        return json.loads(message)

    def open(self, address: str, ready: str = "true") -> None:
        """Go to a page, and wait until it is there and a condition on it holds."""
        self.call("Page.navigate", url=address)
        self.wait_for(f"document.readyState === 'complete' && location.href === {address!r} && ({ready})")

    def look(self, width: int, height: int, scheme: str = "light") -> None:
        """Be a window of a size, in pixels, of somebody who wants it light or dark."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def evaluate(self, expression: str) -> Any:
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def wait_for(self, condition: str) -> None:
        until = time.monotonic() + PATIENCE
        while not self.evaluate(condition):
            assert time.monotonic() < until, f"never came true: {condition}"
            time.sleep(0.02)

    def text(self, identifier: str) -> str:
        return self.evaluate(f"document.getElementById({identifier!r}).textContent")

    def press(self, key: str, text: str = "") -> None:
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def click(self, x: float, y: float) -> None:
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def scrub(self, sample: int) -> None:
        self.evaluate(
            f"(() => {{ const bar = document.getElementById('scrub'); bar.value = '{sample}';"
            " bar.dispatchEvent(new Event('input')); })()"
        )

    def complaints(self) -> list[dict[str, Any]]:
        """Return errors of the console, of scripts, and of the network."""
        return [
            event
            for event in self.events
            if event.get("method") in ("Runtime.exceptionThrown", "Network.loadingFailed")
            or (event.get("method") == "Runtime.consoleAPICalled" and event["params"]["type"] in ("error", "assert"))
            or (event.get("method") == "Log.entryAdded" and event["params"]["entry"]["level"] == "error")
        ]

    def requests(self) -> list[str]:
        sent = (event for event in self.events if event.get("method") == "Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in sent]

    def close(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._output, json.dumps({"id": 0, "method": "Browser.close"}).encode() + b"\0")
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._output)
        os.close(self._input)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Return a browser, one for all tests of pages in this process; a room's conftest.py imports this."""
    browser = Browser(tmp_path_factory.mktemp("chromium"))
    yield browser
    browser.close()
