"""A drive that is watched in a real headless Chromium, and the same drive with nobody there."""

import base64
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bent_roads import WIDTH, circle
from browser import Browser

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.replay_data import BEHIND
from hj_cosim.analysis.view import View
from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import Watch, drive
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.recording.record import RunRecord
from hj_cosim.scene.road import Road
from hj_cosim.traffic.fake import CarStart, FakeWorld
from hj_cosim.watching.drive import PER_SECOND, STRETCH, LiveDrive, drive_page
from hj_cosim.watching.server import WatchServer
from hj_cosim.watching.study import study_page

CARS = [CarStart(lane=1, x=40.0, speed=15.0), CarStart(lane=2, x=-30.0, speed=25.0)]
SECONDS = 3.3  # which do not end with a stretch


def driven(table, watching: LiveDrive | None, *, road: Road | None = None, watch: Watch | None = None) -> RunRecord:
    config = resolve_config("paper", assignments=[f"simulation.duration={SECONDS}", "planner.expansions=20"])
    start = (300.0, 0.0, 0.0, 24.0) if road else (0.0, 4.0, 0.0, 24.0)
    world = FakeWorld(CARS, start, road)
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, table)
    safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step)
    watch = watch if watching is None else watching.beside
    return drive(world, planner, safety_filter, table, config, watch=watch).record


def complaints(browser: Browser) -> list[dict[str, Any]]:
    """Return what the browser complained of; that the page ends its own stream of events is no complaint."""
    return [one for one in browser.complaints() if one["params"].get("type") != "EventSource"]


@pytest.fixture
def server() -> Iterator[WatchServer]:
    with WatchServer(drive_page("</script>paper"), port=0) as server:
        yield server


def test_the_page_shows_the_drive_and_follows_it(browser: Browser, server, small_table):
    browser.events.clear()
    browser.open(server.address, "document.getElementById('watching').textContent.startsWith('waiting')")
    assert server.wait_for_page(20.0)
    live = LiveDrive(server)
    record = driven(small_table, live)
    shown = len(record.time[:: round(1.0 / (PER_SECOND * 0.02))])
    whole = shown - shown % STRETCH  # the rest is sent at the end
    browser.wait_for(f"window.watchedReplay && document.getElementById('scrub').max === '{whole - 1}'")
    assert browser.text("time") == f"{(whole - 1) / PER_SECOND:.2f}"
    live.end("the drive is over")
    browser.wait_for("document.getElementById('watching').textContent === 'the drive is over'")
    assert browser.evaluate("Number(document.getElementById('scrub').max)") == shown - 1

    for sample in (0, 7, shown - 1):  # any of them can be looked at again
        browser.scrub(sample)
        at = sample * round(1.0 / (PER_SECOND * 0.02))
        assert float(browser.text("time")) == pytest.approx(record.time[at], abs=0.0051)
        assert float(browser.text("speed")) == pytest.approx(record.robot.speed[at], abs=0.00051)
        assert float(browser.text("min-gap")) == pytest.approx(record.threats.min_gap[at], abs=0.00051)
        if np.isfinite(record.robot.value[at]):
            assert float(browser.text("value")) == pytest.approx(record.robot.value[at], abs=0.00051)
    browser.scrub(7)
    browser.press("v")
    whose = record.robot.value_vehicle[35]
    assert browser.text("car-name") == (record.traffic.names[whose] if whose >= 0 else "")
    assert complaints(browser) == []
    assert all(url.startswith(f"http://127.0.0.1:{server.port}/") for url in browser.requests())


def sent(server: WatchServer) -> list[Any]:
    """Return the data of all events."""
    lines = [line for event in server._events for line in event.decode().splitlines()]
    return [json.loads(line[6:], parse_constant=pytest.fail) for line in lines if line.startswith("data: ")]


def test_a_road_that_bends_is_sent_once_and_drawn_as_it_bends(browser: Browser, server, small_table):
    live, road = LiveDrive(server), circle(300.0)
    record = driven(small_table, live, road=road)
    browser.open(server.address, "window.watchedReplay && document.getElementById('scrub').max === '29'")
    first, *others = sent(server)
    assert not any("bend" in other for other in others)
    browser.scrub(20)
    at = record.robot.x[100]

    def colour(ahead: float, lateral: float) -> list[int]:
        x, y = View(road, float(at)).points(np.array([[at + ahead, lateral]]))[0]
        place = f"({x - at + BEHIND}) * scale, 12 + ({first['bend']['high'] - y}) * scale"
        return browser.evaluate(
            "(() => { const c = document.getElementById('view'), scale = c.width / 150;"
            f" return [...c.getContext('2d').getImageData({place}, 1, 1).data]; }})()"
        )[:3]

    assert colour(0.0, float(record.robot.y[100])) == [0xD5, 0x5E, 0x00]
    assert colour(95.0, -1.2) == [0xF1, 0xF1, 0xEE]
    assert colour(95.0, -0.5 * WIDTH - 3.0) == [255, 255, 255]
    assert complaints(browser) == []


def test_what_the_filter_believes_of_each_car_is_sent(server, small_table):
    live, believing = LiveDrive(server), resolve_config("paper", assignments=["filter.priority=belief"])

    def watch(config, world, record):
        tell = live.beside(believing.model_copy(update={"simulation": config.simulation}), world, record)

        def told(observation, values, plan, desired, decision, *others):
            belief = 0.25 * (1.0 + observation.vehicle)
            tell(observation, values, plan, desired, replace(decision, belief=belief), *others)

        return told

    driven(small_table, None, watch=watch)
    stretches = sent(server)
    for stretch in stretches:
        cars = {name: base64.b64decode(stretch["cars"][name]["data"]) for name in ("vehicle", "belief")}
        belief, vehicle = np.frombuffer(cars["belief"], "<f4"), np.frombuffer(cars["vehicle"], "<u4")
        np.testing.assert_array_equal(belief, 0.25 * (1.0 + vehicle))
    assert set(vehicle) == {0, 1}
    assert stretches[0]["ring"] == list(style.RING)


def test_who_looks_back_is_not_carried_on(browser: Browser, server, small_table):
    live = LiveDrive(server)
    driven(small_table, live)
    browser.open(server.address, "window.watchedReplay && document.getElementById('scrub').max === '29'")
    browser.scrub(4)
    live.end("over")
    browser.wait_for("document.getElementById('watching').textContent === 'over'")
    assert browser.text("time") == "0.40"


def test_the_same_is_driven_whether_somebody_looks_or_not(server, small_table):
    alone, watched = driven(small_table, None), driven(small_table, LiveDrive(server))
    for name in ("x", "y", "heading", "speed", "omega", "acceleration", "value"):
        np.testing.assert_array_equal(getattr(alone.robot, name), getattr(watched.robot, name))


def test_stretches_are_json_without_what_json_has_not(server, small_table):
    live = LiveDrive(server)
    driven(small_table, live)
    live.end("over")
    first, *others, last = sent(server)
    assert "belief" not in first["cars"]
    assert first["expected"] == round(SECONDS * PER_SECOND)
    assert first["names"] == ["0", "1"] or len(first["names"]) == len(CARS)
    assert all(other["names"] == [] for other in others)
    assert last == "over"


def test_the_page_of_a_study_shows_how_it_stands(browser: Browser):
    browser.events.clear()
    state = {"done": 3, "total": 8, "failed": 1, "running": [["<b>row</b>", "1000", "7"]], "rows": [["row", "3 of 8"]]}
    with WatchServer(study_page(), port=0) as server:
        browser.open(server.address)
        server.publish("state", json.dumps(state))
        browser.wait_for("document.getElementById('watching').textContent.startsWith('3 of 8 episodes are driven, 1')")
        cell = "document.querySelector('#running tbody td')"
        assert browser.evaluate(f"{cell}.textContent") == "<b>row</b>"
        assert browser.evaluate("document.querySelectorAll('#standing tbody tr').length") == 1
        server.publish("end", json.dumps("it is over"))
        browser.wait_for("document.getElementById('watching').textContent === 'it is over'")
        assert browser.evaluate(f"{cell} === null")
    assert complaints(browser) == []
