"""The page about two runs side by side, in a real headless Chromium: one bar moves both replays."""

from dataclasses import replace

import pytest

from hj_cosim.analysis.comparison_page import ComparedRows, comparison_page
from hj_cosim.analysis.figures.side_by_side import side_by_side
from hj_cosim.recording.run_folder import read_run
from hj_cosim.study.comparison import groups_of

HOSTILE = "</iframe><script>document.title='broken'</script>"


@pytest.fixture(scope="module")
def runs(tmp_path_factory, make_hostile_run):
    """Return two runs of one drive, the second of which ended after a second."""
    run = read_run(make_hostile_run(tmp_path_factory.mktemp("compared") / "run", HOSTILE))
    record = run.record
    short = replace(
        record,
        time=record.time[:50],
        robot=record.robot.first(50),
        traffic=record.traffic.first(50),
        threats=replace(record.threats, **{name: getattr(record.threats, name)[:50] for name in vars(record.threats)}),
    )
    return {HOSTILE: run, "short": replace(run, record=short)}


@pytest.fixture(scope="module")
def address(runs, table, tmp_path_factory, make_hostile_run):
    folder = tmp_path_factory.mktemp("page")
    (group,) = groups_of([next(iter(runs.values())).folder, make_hostile_run(folder / "other", "plain")])
    settings = [("planner.kind", ["<b>", "op"]), ("scenario.drivers.desired_speed.deviation", ["a" * 80, "1.5"])]
    rows = [ComparedRows("", group.table(), settings)]
    page = comparison_page(rows, runs, side_by_side(runs), dict.fromkeys(runs, table))
    (folder / "page.html").write_text(page)
    return (folder / "page.html").as_uri()


@pytest.fixture
def page(browser, address):
    browser.events.clear()
    browser.look(1120, 900)
    browser.open(address, "document.body.dataset.ready === 'true'")
    return browser


def times(page):
    return page.evaluate(
        "[...document.querySelectorAll('iframe')].map(f => f.contentDocument.getElementById('time').textContent)"
    )


def test_one_bar_moves_all_replays_and_who_ended_early_stays(page):
    assert times(page) == ["0.00", "0.00"]
    page.evaluate(
        "(() => { const bar = document.getElementById('scrub'); bar.value = '0.5';"
        " bar.dispatchEvent(new Event('input')); })()"
    )
    assert times(page) == ["0.50", "0.50"]
    page.press("End")
    assert times(page) == ["2.98", "0.98"]
    assert page.text("time") == "2.98"
    page.press("ArrowLeft")
    assert times(page) == ["2.96", "0.98"]


def test_playing_moves_both_to_the_end(page):
    page.evaluate("document.getElementById('rate').value = '4'")
    page.press(" ", " ")
    page.wait_for("document.getElementById('play').textContent === 'play'")
    assert times(page) == ["2.98", "0.98"]


def test_nothing_hostile_runs_and_nobody_is_asked(page, address):
    assert page.complaints() == []
    assert page.evaluate("document.title") != "broken"
    allowed = ("data:", "about:srcdoc")
    assert all(url == address or url.startswith(allowed) for url in page.requests())


def test_a_replay_is_seen_whole_in_its_frame(page):
    """However much is written below it."""
    page.press("End")
    sizes = page.evaluate(
        "[...document.querySelectorAll('iframe')].map(f => { const b = f.contentDocument.body;"
        " return [b.scrollHeight, f.clientHeight, b.scrollWidth, f.clientWidth]; })"
    )
    for height, room_below, width, room_beside in sizes:
        assert 200 < height <= room_below
        assert 200 < width <= room_beside


def test_a_window_that_is_made_wide_again_leaves_no_gap_below_the_replays(page):
    heights = "[...document.querySelectorAll('iframe')].map(f => f.clientHeight)"
    wide = page.evaluate(heights)
    page.look(390, 900)
    page.wait_for(f"{heights}.every((height, k) => height !== {wide}[k])")
    page.look(1120, 900)
    page.wait_for(f"JSON.stringify({heights}) === '{wide}'.replaceAll(' ', '')")


def test_a_figure_on_a_telephone_scrolls_by_itself_and_its_letters_can_be_read(page):
    page.look(390, 900)
    width = page.evaluate("document.querySelector('figure img').clientWidth")
    assert width * 7.0 / (178.0 * 72.0 / 25.4) > 8.0  # pixels, of what is 7 points in print
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize("width", [390, 1120])
def test_settings_that_differ_are_read_without_scrolling(page, width):
    page.look(width, 900)
    table = "document.querySelector('.settings table')"
    assert page.evaluate(f"{table}.scrollWidth <= {table}.parentElement.clientWidth")
    assert page.evaluate(f"[...{table}.querySelectorAll('td, th')].every(cell => cell.scrollWidth <= cell.clientWidth)")
