"""The report's replay in a real headless Chromium."""

import time

import numpy as np
import pytest
from browser import Browser

from hj_cosim.analysis import report
from hj_cosim.analysis.report import write_report
from hj_cosim.analysis.values import car_values
from hj_cosim.recording.run_folder import Run, read_run


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
    browser.open(address, "document.getElementById('time').textContent !== ''")
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


@pytest.mark.parametrize("width", [390, 1400])
def test_no_name_in_the_summary_touches_its_number(page, width):
    page.look(width, 900)
    gaps = page.evaluate(
        "[...document.querySelectorAll('#summary div')].map(pair => { const ends = [...pair.children].map("
        "part => part.getBoundingClientRect()); return ends.at(-1).left - ends[0].right; })"
    )
    assert len(gaps) > 20
    assert min(gaps) >= 8.0
