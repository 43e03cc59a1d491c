"""The report's replay of a drive on a bend, in a real headless Chromium."""

import numpy as np
import pytest
from bent_roads import WIDTH, circle

from hj_cosim.analysis import report
from hj_cosim.analysis.replay_data import AHEAD, BEHIND
from hj_cosim.analysis.report import run_page
from hj_cosim.analysis.view import View, height_of
from hj_cosim.recording.run_folder import Run


@pytest.fixture
def run(make_record, config, tmp_path) -> Run:
    summary = {"scenario": "bend", "planner": "hjop", "filter": "spc", "seed": 0}
    return Run(
        tmp_path,
        config.model_dump(mode="json", exclude_none=True),
        summary,
        make_record(samples=60, road=circle(300.0)),
    )


def test_the_page_draws_the_robot_and_the_road_where_the_bend_has_them(run, table, browser, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "RUN_FIGURES", {})
    path = tmp_path / "page.html"
    path.write_text(run_page(run, table, lambda *_: None), encoding="utf-8")
    browser.events.clear()
    browser.open(path.as_uri(), "document.getElementById('time').textContent !== ''")
    sample, record = 30, run.record
    browser.scrub(sample)
    high = height_of(record.road, record.robot.x[::50], BEHIND, AHEAD)[1]
    view = View(record.road, float(record.robot.x[sample]))

    def colour(ahead: float, lateral: float) -> list[int]:
        x, y = view.points(np.array([[record.robot.x[sample] + ahead, lateral]]))[0]
        return browser.evaluate(
            "(() => { const c = document.getElementById('view'), scale = c.width / 150;"
            f" return [...c.getContext('2d').getImageData(({x - record.robot.x[sample] + BEHIND}) * scale,"
            f" 12 + ({high + 1.0 - y}) * scale, 1, 1).data]; }})()"
        )[:3]

    assert colour(0.0, float(record.robot.y[sample])) == [0xD5, 0x5E, 0x00]
    assert colour(95.0, -1.2) == [0xF1, 0xF1, 0xEE]
    assert colour(95.0, -0.5 * WIDTH - 3.0) == [255, 255, 255]
    assert colour(-48.0, -1.2) == [0xF1, 0xF1, 0xEE]
    assert browser.complaints() == []
