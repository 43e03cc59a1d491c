import json
import re
from pathlib import Path

import pandas as pd
import pytest

from hj_cosim.analysis import report
from hj_cosim.analysis.report import write_report
from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.recording.study_files import OWN_FILES

HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def hostile_report(tmp_path_factory, make_hostile_run, table) -> Path:
    """Return the report of a run in which a car and the scenario have hostile names."""
    folder = make_hostile_run(tmp_path_factory.mktemp("report") / "run", HOSTILE)
    with pytest.MonkeyPatch.context() as patch:  # the browser's test has all figures, here one is enough
        patch.setattr(report, "RUN_FIGURES", {"timeline": HOSTILE})
        return write_report(folder, table=table)


def test_a_report_escapes_what_comes_from_the_run(hostile_report):
    page = hostile_report.read_text()
    assert HOSTILE not in page
    assert "<img src=x" not in page
    data = re.search(r'<script type="application/json" id="run">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert HOSTILE in json.loads(data.group(1))["names"]


def test_a_report_loads_nothing_from_anywhere_and_is_small(hostile_report):
    page = hostile_report.read_text()
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 1
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "url(" not in page
    assert "default-src 'none'" in page
    assert hostile_report.stat().st_size < 8_000_000


def test_a_study_s_report_holds_its_table_with_intervals(tmp_path):
    metrics = ("mean_speed", "ttc_ge_3", "ttc_2d_p1")
    rows = [
        {"scenario": "paper", "planner": planner, "filter": "spc", "scheme": "mi", "episodes": 2, "missing": 1}
        | {f"{metric}{end}": value for metric in metrics for end, value in (("", 0.5), ("_lo", 0.25), ("_hi", 0.75))}
        for planner in ("hjop", "<b>")
    ]
    pd.DataFrame(rows).to_csv(tmp_path / "table.csv", index=False)
    comparison = pd.DataFrame(rows).assign(mean_speed_paper=22.13).drop(columns="missing")
    comparison.to_csv(tmp_path / "comparison.csv", index=False)

    page = write_report(tmp_path).read_text()

    assert "0.50 [0.25, 0.75]" in page
    assert '<th scope="col">mean speed (m/s), paper</th>' in page
    assert page.count("<td>22.13</td>") == 2
    assert "&lt;b&gt;" in page
    assert "<td><b></td>" not in page
    assert "2 episodes are missing" in page


def test_a_folder_without_run_or_study_is_refused(tmp_path):
    with pytest.raises(RunFolderError, match="neither a run nor a study"):
        write_report(tmp_path)


@pytest.mark.parametrize("name", ["mine.py", "report", "report.html.gz"])
def test_a_report_takes_no_other_file_s_name(tmp_path, monkeypatch, name):
    (tmp_path / "robot.parquet").touch()
    (tmp_path / name).write_text("mine")
    monkeypatch.setattr(report, "read_run", lambda folder: pytest.fail("it was read before the name was"))
    with pytest.raises(OutputError, match=r"a report ends in \.html or \.htm"):
        write_report(tmp_path, tmp_path / name)
    assert (tmp_path / name).read_text() == "mine"


@pytest.mark.parametrize("name", OWN_FILES)
def test_a_report_never_takes_the_place_of_what_a_study_found(tmp_path, name):
    for own in OWN_FILES:
        (tmp_path / own).write_text("found")
    with pytest.raises(RunFolderError, match=r"belongs to the study in .*; choose another name with --out"):
        write_report(tmp_path, tmp_path / name)
    assert {path.read_text() for path in tmp_path.iterdir()} == {"found"}


def test_a_report_is_written_again_and_its_ending_may_be_in_capitals(tmp_path, monkeypatch):
    (tmp_path / "table.csv").touch()
    (tmp_path / "report.html").write_text("older")
    monkeypatch.setattr(report, "study_page", lambda *_, replays: "newer")
    for path in (write_report(tmp_path), write_report(tmp_path, tmp_path / "A.HTM")):
        assert path.read_text() == "newer"
