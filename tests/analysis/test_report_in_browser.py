"""The report's replay in a real headless Chromium, driven through its debugging pipe."""

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

import numpy as np
import pytest

from hj_cosim.analysis import report
from hj_cosim.analysis.report import write_report
from hj_cosim.analysis.values import car_values
from hj_cosim.recording.run_folder import Run, read_run

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

    def open(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete' && document.getElementById('time').textContent !== ''")

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


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Browser]:
    browser = Browser(tmp_path_factory.mktemp("chromium"))
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def run(tmp_path_factory, make_hostile_run) -> Run:
    hostile = "</script><img src=x onerror=document.title='broken'>"
    return read_run(make_hostile_run(tmp_path_factory.mktemp("run") / "run", hostile))


@pytest.fixture(scope="module")
def address(run, table) -> str:
    with pytest.MonkeyPatch.context() as patch:  # figures are tested by themselves; two will do to see them loaded
        patch.setattr(report, "RUN_FIGURES", {"timeline": "over time", "highway": "from above"})
        return write_report(run.folder, table=table).as_uri()


@pytest.fixture
def page(browser, address) -> Browser:
    browser.events.clear()
    browser.open(address)
    return browser


def shown(page: Browser, identifier: str) -> float:
    text = page.text(identifier)
    return float("inf") if text == "∞" else float(text)


def assert_shows(page: Browser, run: Run, sample: int) -> None:
    """Compare what the page shows with the data of a sample, to the digits shown."""
    robot, threats = run.record.robot, run.record.threats
    assert shown(page, "time") == pytest.approx(run.record.time[sample], abs=0.0051)
    for identifier, value in (
        ("speed", robot.speed[sample]),
        ("acceleration", robot.acceleration[sample]),
        ("value", robot.value[sample]),
        ("ttc", threats.ttc[sample]),
        ("min-gap", threats.min_gap[sample]),
    ):
        assert shown(page, identifier) == pytest.approx(value, abs=0.00051), identifier
    assert shown(page, "plan-lane") == robot.plan_lane[sample]
    assert (page.text("intervening") != "") == robot.intervening[sample]
    assert (page.text("collision") != "") == threats.collision[sample]


def test_the_page_loads_without_a_complaint_and_asks_nobody(page, address):
    assert page.requests()
    assert all(url == address or url.startswith("data:") for url in page.requests())
    assert page.complaints() == []
    assert page.evaluate("document.title") != "broken"
    assert page.evaluate("document.querySelectorAll('img').length") == page.evaluate(
        "document.querySelectorAll('figure').length"
    )


@pytest.mark.parametrize("sample", [0, 1, 60, 149])
def test_scrubbing_shows_the_data_of_that_sample(page, run, sample):
    page.scrub(sample)
    assert_shows(page, run, sample)


def test_playing_goes_on_to_the_end_and_stops_there(page, run):
    page.scrub(140)
    page.press(" ", " ")
    page.wait_for("document.getElementById('play').textContent === 'play'")
    assert_shows(page, run, 149)
    page.evaluate("document.getElementById('play').click()")
    page.wait_for("Number(document.getElementById('time').textContent) > 0.1")
    page.press(" ", " ")
    stopped = page.text("time")
    time.sleep(0.1)
    assert page.text("time") == stopped
    assert 0.0 < float(stopped) < 2.98


def test_keys_move_by_a_sample_a_second_and_to_the_ends(page, run):
    page.press("End")
    assert_shows(page, run, 149)
    page.press("ArrowLeft")
    assert_shows(page, run, 148)
    page.press("Home")
    page.press("ArrowRight")
    assert_shows(page, run, 1)
    page.press("+", "+")
    assert page.evaluate("document.getElementById('rate').value") == "2"


def test_jumps_lead_to_the_intervention_the_lowest_ttc_and_the_collision(page, run):
    record = run.record
    page.press("i", "i")
    assert_shows(page, run, next_onset(record.robot.intervening, 0))
    page.press("Home")
    page.press("c", "c")
    assert_shows(page, run, next_onset(record.threats.collision, 0))
    page.press("t", "t")
    assert_shows(page, run, int(np.argmin(record.threats.ttc)))


def next_onset(flag: np.ndarray, after: int) -> int:
    samples = [*range(after + 1, len(flag)), *range(after + 1)]
    return next(k for k in samples if flag[k] and (k == 0 or not flag[k - 1]))


def test_a_clicked_car_shows_its_value_gap_and_ttc(page, run, table):
    record, sample = run.record, 75
    page.scrub(sample)
    traffic = record.traffic
    ahead = traffic.x[sample] - record.robot.x[sample]
    aside = traffic.y[sample] - record.robot.y[sample]
    in_way = traffic.present[sample] & (ahead > 0) & (ahead < 90) & (np.abs(aside) < 2.0)
    leader = int(np.flatnonzero(in_way)[np.argmin(ahead[in_way])])
    box = page.evaluate(
        "(({ left, top, width }) => [left, top, width])(document.getElementById('view').getBoundingClientRect())"
    )
    scale = box[2] / 150.0
    drawn = page.evaluate("document.getElementById('view').width") / box[2]
    x = box[0] + (ahead[leader] + 50.0) * scale
    y = box[1] + 12.0 / drawn + (3.5 * 4.0 - traffic.y[sample, leader]) * scale
    page.click(x, y)

    name = page.text("car-name")
    car = traffic.names.index(name)
    gap = abs(ahead[car]) - 5.0
    closing = record.robot.speed[sample] - traffic.speed[sample, car]
    assert abs(ahead[car] - ahead[leader]) < 6.0  # cars overlap in this made-up traffic: one of those under the click
    assert shown(page, "car-gap") == pytest.approx(gap, abs=0.002)
    assert shown(page, "car-value") == pytest.approx(car_values(record, table)[sample, car], abs=0.002)
    expected = max(gap, 0.0) / closing if closing > 0.0 and abs(aside[car]) < 2.0 and ahead[car] > 0.0 else np.inf
    assert shown(page, "car-ttc") == pytest.approx(expected, rel=1e-2, abs=0.002)
    assert page.complaints() == []
