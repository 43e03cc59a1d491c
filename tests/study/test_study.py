import importlib
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.files import UNFINISHED
from hj_cosim.recording.study_files import read_study_file, study_progress
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.request import given_fields
from hj_cosim.study.study import new_study_folder, read_study, run_study, write_tables
from hj_cosim.study.tables import read_csv

A_SWEEP = {"scenarios": ("light", "paper"), "episodes": 2, "vary": ("planner.gamma_r=0.8,0.9",), "stacks": ("op-none",)}


def test_files_are_named_by_whole_paths_so_that_a_study_goes_on_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = given_fields(
        scenarios=["light", "mine.toml", Path("mine.toml")],
        stacks="mine.py:KeepRight/none",
        vary=["table=mine.toml, highway", "planner.gamma_r=0.8,0.9"],
        set=["table=mine.npz", ' table = "mine.toml"', "table=highway", "planner.options.table=mine.toml", "table"],
    )
    mine = f"{tmp_path}/mine"
    assert given == {
        "scenarios": ("light", f"{mine}.toml", f"{mine}.toml"),
        "stacks": (f"{mine}.py:KeepRight/none",),
        "vary": (f"table={mine}.toml,highway", "planner.gamma_r=0.8,0.9"),
        "set": (f"table={mine}.npz", f"table={mine}.toml", "table=highway", "planner.options.table=mine.toml", "table"),
    }


def test_the_table_has_a_row_per_stack_with_intervals(conduct_synthetic):
    study = conduct_synthetic("study")
    table = pd.read_csv(study.folder / "table.csv")
    pd.testing.assert_frame_equal(table, study.table)
    assert list(table.columns[:8]) == [
        *("scenario", "planner", "filter", "scheme", "episodes", "missing"),
        *("ttc_ge_3", "ttc_ge_3_lo"),
    ]
    assert list(table["planner"]) == ["hjop", "op"]
    assert list(table["scheme"]) == ["mi", "-"]
    assert (table["episodes"] == 4).all()
    assert (table["mean_speed_lo"] <= table["mean_speed"]).all()
    assert (table["mean_speed"] <= table["mean_speed_hi"]).all()
    assert not any("wall" in column for column in table.columns)


def test_there_is_a_row_per_episode_and_a_run_folder_for_each(conduct_synthetic):
    study = conduct_synthetic("study")
    episodes = pq.read_table(study.folder / "episodes.parquet").to_pandas()
    assert list(zip(episodes["planner"], episodes["seed"], strict=True)) == [
        (p, s) for p in ("hjop", "op") for s in range(4)
    ]
    for row in episodes.itertuples():
        stack = "hjop-spc-mi" if row.planner == "hjop" else "op-none"
        folder = study.folder / "episodes" / stack / str(row.seed)
        assert (folder / "summary.json").is_file()
        assert (folder / "trajectories.parquet").is_file()
        assert row.scheme == ("mi" if row.planner == "hjop" else "-")


def test_windows_are_ten_seconds_of_an_episode(conduct_synthetic):
    study = conduct_synthetic("study")
    windows = pq.read_table(study.folder / "windows.parquet").to_pandas()
    own = windows[(windows["planner"] == "op") & (windows["seed"] == 2)]
    robot = pq.read_table(study.folder / "episodes" / "op-none" / "2" / "robot.parquet").to_pandas()
    assert list(own["start"]) == [0.0, 10.0]
    second = robot[robot["time"] >= 10.0 - 1e-9]
    assert own["mean_speed"].iloc[1] == pytest.approx(second["speed"].mean())
    assert own["ttc_p1"].iloc[1] == np.percentile(second["ttc"], 1, method="lower")


def test_rows_are_compared_pair_by_pair_on_the_same_seeds(conduct_synthetic):
    differences = conduct_synthetic("study").differences
    assert len(differences) == 1
    row = differences.iloc[0]
    assert (row["planner"], row["other_planner"], row["episodes"]) == ("hjop", "op", 4)
    assert row["mean_speed_lo"] <= row["mean_speed"] <= row["mean_speed_hi"] < 0.0


def test_a_single_row_has_nothing_to_be_compared_with(conduct_synthetic):
    study = conduct_synthetic("study", episodes=1, stacks=("op-none",))
    assert pd.read_csv(study.folder / "differences.csv").empty
    assert pd.read_csv(study.folder / "claims.csv").empty


@pytest.mark.usefixtures("without_figures")
def test_the_papers_numbers_stand_beside_ours_where_its_stacks_drive_in_its_traffic(conduct_synthetic):
    own_traffic = {"scenarios": ("dense", "paper"), "stacks": ("op-none", "idle-none", "hjop-spc-mi")}
    comparison = conduct_synthetic("study", **own_traffic).comparison
    assert list(comparison["scenario"]) == ["paper", "paper"]
    assert list(comparison["planner"]) == ["op", "hjop"]
    assert list(comparison["mean_speed_paper"]) == [28.141, 22.0]
    assert list(comparison["ttc_ge_3_paper"]) == [0.502, 0.999]


@pytest.mark.usefixtures("without_figures")
def test_other_traffic_than_the_papers_has_no_numbers_of_the_paper_and_no_claims(conduct_synthetic):
    assert not conduct_synthetic("paper").claims.empty
    for name, changes in {"dense": {"scenarios": ("dense",)}, "few": {"set": ("scenario.traffic.count=50",)}}.items():
        study = conduct_synthetic(name, **changes)
        assert study.comparison.empty
        assert study.claims.empty
        assert read_study(study.folder).comparison.empty


@pytest.mark.usefixtures("without_figures")
def test_a_sweep_has_columns_for_what_varies_and_compares_one_factor_at_a_time(conduct_synthetic):
    swept = conduct_synthetic("study", scenarios=("light", "paper"), episodes=1, vary=("planner.gamma_r=0.8,0.9",))
    assert len(swept.table) == 8
    assert list(swept.table["planner.gamma_r"].unique()) == [0.8, 0.9]
    # Each of the 8 rows has one neighbour in each of the three factors.
    assert len(swept.differences) == 8 * 3 // 2
    assert (swept.folder / "episodes" / "light" / "planner.gamma_r=0.8" / "op-none" / "0" / "summary.json").is_file()


def test_the_files_are_the_same_for_any_number_of_workers(conduct_synthetic, reproducible_files):
    reference = conduct_synthetic("reference")
    for workers in (1, 2):
        other = conduct_synthetic(f"of {workers}", LocalWorkers(workers))
        assert reproducible_files(reference.folder) == reproducible_files(other.folder)


def test_a_study_that_was_killed_over_its_first_file_can_be_begun_again(conduct_synthetic, tmp_path):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / f".study{UNFINISHED}killed.toml").write_text("episodes = ")
    assert conduct_synthetic("study").failures == ()
    assert not list((tmp_path / "study").glob(".*"))


def test_a_failed_episode_is_reported_counted_as_missing_and_driven_again_on_resume(
    conduct_synthetic, reproducible_files, synthetic
):
    reference = conduct_synthetic("reference")
    study = conduct_synthetic("study", function=synthetic.drive_or_fail)
    (failure,) = study.failures
    assert (failure.stack, failure.seed) == ("op-none", synthetic.UNLUCKY_SEED)
    assert failure.log.read_text() == "the traffic could not be settled\n\nits log"
    assert list(study.table["episodes"]) == [4, 3]
    assert list(study.table["missing"]) == [0, 1]
    assert study.differences["episodes"].iloc[0] == 3

    again = conduct_synthetic("study", resume=True)
    assert again.failures == ()
    assert not (again.folder / "failures").exists()
    assert reproducible_files(again.folder) == reproducible_files(reference.folder)


def test_a_row_without_any_episode_is_still_there(conduct_synthetic, synthetic):
    study = conduct_synthetic("study", episodes=1, seed=synthetic.UNLUCKY_SEED, function=synthetic.drive_or_fail)
    assert study.missing == 1
    assert list(study.table["episodes"]) == [1, 0]
    assert np.isnan(study.table["mean_speed"].iloc[1])


def test_a_resumed_study_may_get_more_episodes(conduct_synthetic, reproducible_files):
    reference = conduct_synthetic("reference", episodes=6)
    conduct_synthetic("study")
    grown = conduct_synthetic("study", episodes=6, resume=True)
    assert reproducible_files(grown.folder) == reproducible_files(reference.folder)


CONTRADICTIONS = {
    "scenarios": (("dense",), r"scenarios = \['paper'\], but scenarios = \['dense'\] is asked for now"),
    "stacks": (("op-none",), r"stacks = \['hjop-spc-mi', 'op-none'\], but stacks = \['op-none'\]"),
    "episodes": (3, r"episodes = 4, but episodes = 3 is asked for now; ask for as many or more"),
    "seed": (1, r"seed = 0, but seed = 1"),
    "preset": ("paper", r"preset = 'best', but preset = 'paper'"),
    "vary": (("filter.epsilon=2,5",), r"vary = \[\], but vary = \['filter.epsilon=2,5'\]"),
    "set": (("filter.epsilon=5",), r"set = \[\], but set = \['filter.epsilon=5'\]"),
    "keep": ("robot", r"keep = 'all', but keep = 'robot'"),
    "traffic": ("idm-mobil", r"traffic = 'theirs', but traffic = 'idm-mobil'"),
}


@pytest.mark.parametrize("field", CONTRADICTIONS)
def test_what_contradicts_the_study_is_refused_with_both_values_and_nothing_is_written(study_folder, field):
    folder = study_folder("study")
    folder.begin({"hj-cosim": "1.0"}, resume=False)
    before = (folder.path / "study.toml").read_bytes()
    value, said = CONTRADICTIONS[field]
    name = "settings" if field == "set" else field
    with pytest.raises(ConfigurationError, match=said):
        run_study(resume=True, out=folder.path, **{name: value})
    assert [path.name for path in folder.path.iterdir()] == ["study.toml"]
    assert (folder.path / "study.toml").read_bytes() == before


@pytest.mark.usefixtures("without_figures")
def test_study_toml_has_all_that_was_asked_for(conduct_synthetic):
    folder = conduct_synthetic("study", **A_SWEEP, seed=7, keep="robot", set=("filter.epsilon=3",)).folder
    file = read_study_file(folder)
    assert (file.scenarios, file.stacks, file.vary) == (A_SWEEP["scenarios"], A_SWEEP["stacks"], A_SWEEP["vary"])
    assert (file.episodes, file.seed, file.preset, file.set, file.keep) == (
        2,
        7,
        "best",
        ("filter.epsilon=3",),
        "robot",
    )
    assert file.program == {"hj-cosim": "1.0"}
    assert not list(folder.glob("episodes/**/trajectories.parquet"))
    assert len(list(folder.glob("episodes/**/robot.parquet"))) == 8


def test_a_sweep_is_resumed_by_its_folder_alone(conduct_synthetic, reproducible_files, synthetic, monkeypatch):
    reference = conduct_synthetic("reference", **A_SWEEP)
    with monkeypatch.context() as patch:
        patch.setattr("hj_cosim.study.study.draw_figures", lambda *_: None)  # the resumed one does
        conduct_synthetic("sweep", **A_SWEEP, function=synthetic.drive_or_fail)
    again = conduct_synthetic("sweep", resume=True)
    assert (again.folder / "figures" / "sweep.png").is_file()
    assert reproducible_files(again.folder) == reproducible_files(reference.folder)


@pytest.mark.parametrize("asked", [{}, {"episodes": 4}])
def test_a_finished_study_that_is_resumed_stays_as_it_is(
    study_folder, tmp_path, asked, monkeypatch, synthetic, in_this_process
):
    study_module = importlib.import_module("hj_cosim.study.study")
    monkeypatch.setattr(study_module, "drive_episode", synthetic.drive)
    monkeypatch.setattr(study_module, "load_tables", lambda name, sizes, progress, *, robot: None)
    monkeypatch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: in_this_process)
    options = {"stacks": ["hjop-spc-mi", "op-none"], "episodes": 4, "workers": 1, "out": str(tmp_path / "study")}
    study = run_study(**options)
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in study.folder.rglob("*") if path.is_file()}
    monkeypatch.setattr(study_module, "drive_episode", synthetic.never_finish)
    again = run_study(resume=True, out=study.folder, **asked)
    after = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in study.folder.rglob("*") if path.is_file()}
    assert after == before
    for name in ("table", "differences", "comparison", "claims"):
        pd.testing.assert_frame_equal(getattr(again, name), getattr(study, name))


def test_a_table_that_was_lost_is_made_again(conduct_synthetic, reproducible_files):
    folder = conduct_synthetic("study").folder
    before = reproducible_files(folder)
    (folder / "claims.csv").unlink()
    with pytest.raises(RunFolderError, match=r"claims\.csv is missing"):
        read_study(folder)
    assert not StudyFolder.of(folder, read_study_file(folder)).is_finished()
    conduct_synthetic("study", resume=True)
    assert reproducible_files(folder) == before


def test_a_folder_without_a_study_is_not_resumed_into(tmp_path):
    for content in ({}, {"notes.txt": "mine"}, {"study.toml": ""}, {"study.toml": 'title = "of something else"\n'}):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        for name, text in content.items():
            (folder / name).write_text(text)
        with pytest.raises(ConfigurationError, match=r"holds no study: study\.toml is missing|study\.toml: "):
            run_study(resume=True, out=folder)
        assert {path.name: path.read_text() for path in folder.iterdir()} == content
    with pytest.raises(ConfigurationError, match="give its folder: --resume --out DIR"):
        run_study(resume=True)


@pytest.mark.usefixtures("without_figures")
def test_a_scenario_that_was_changed_since_is_not_mixed_in(conduct_synthetic, tmp_path):
    scenario = tmp_path / "mine.toml"
    scenario.write_text("[traffic]\ncount = 6\n")
    folder = conduct_synthetic("study", scenarios=(str(scenario),)).folder
    before = (folder / "study.toml").read_bytes()
    scenario.write_text("[traffic]\ncount = 7\n")
    with pytest.raises(RunFolderError, match=r"another configuration .* scenario\.traffic\.count was 6 and is 7"):
        conduct_synthetic("study", resume=True, episodes=9)
    assert (folder / "study.toml").read_bytes() == before


@pytest.mark.usefixtures("without_figures")
def test_how_far_a_study_is(study_folder, conduct_synthetic, synthetic):
    folder = study_folder("study", **A_SWEEP)
    folder.begin({"hj-cosim": "1.0"}, resume=False)
    assert study_progress(folder.path).text == "0 of 8 episodes"
    for job in folder.remaining_jobs(dict.fromkeys(folder.tables, (folder.path,)))[:3]:
        synthetic.drive(job)
    unfinished = folder.path / "episodes" / "light" / f".0{UNFINISHED}x"
    unfinished.mkdir()
    (unfinished / "summary.json").write_text("{}")
    progress = study_progress(folder.path)
    assert (progress.text, progress.is_unfinished) == ("3 of 8 episodes", True)
    conduct_synthetic("study", resume=True)
    assert not study_progress(folder.path).is_unfinished


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"stacks": 3}, "stacks: 3 is no text"),
        ({"stacks": [object()]}, "stacks: a object is no text"),
        ({"stacks": []}, "stacks = "),
        ({"scenarios": {1: 2}}, "scenarios: a dict is no text"),
        ({"settings": 5.0}, "set: 5.0 is no text"),
        ({"vary": [None]}, "vary: a NoneType is no text"),
        ({"episodes": "many"}, "episodes = 'many'"),
        ({"episodes": 0}, "episodes = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"keep": "some"}, "keep = 'some': input should be 'all' or 'robot'"),
        ({"preset": "bst"}, "no preset is called 'bst'"),
        ({"out": 3}, "out: 3 is no path"),
        ({"workers": "two"}, "workers = 'two' is no whole number"),
        ({"scheduler": 8786}, "scheduler = 8786 is no text"),
    ],
)
def test_a_value_of_the_wrong_kind_is_answered_by_one_sentence(given, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match=re.escape(said)):
        run_study(**given)
    assert list(tmp_path.iterdir()) == []


def test_episodes_of_another_version_are_not_mixed_in(conduct_synthetic):
    conduct_synthetic("study")
    with pytest.raises(RunFolderError, match=r"begun with hj-cosim 1\.0, this is 2\.0"):
        conduct_synthetic("study", resume=True, version="2.0")


def test_a_folder_in_use_is_refused_before_any_work(conduct_synthetic, tmp_path):
    conduct_synthetic("study")
    with pytest.raises(RunFolderError, match="already holds a study; add --resume"):
        conduct_synthetic("study")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(RunFolderError, match="is not empty"):
        conduct_synthetic("other")
    assert (tmp_path / "other" / "notes.txt").read_text() == "mine"


def test_a_broken_run_folder_is_named(conduct_synthetic, study_folder):
    study = conduct_synthetic("study")
    broken = study.folder / "episodes" / "op-none" / "2"
    (broken / "robot.parquet").write_bytes(b"PAR1")
    with pytest.raises(RunFolderError, match=r"op-none/2 holds no readable run .*remove it and --resume"):
        write_tables(study_folder("study"))


def test_progress_counts_every_episode(conduct_synthetic):
    reports = []
    conduct_synthetic("study", progress=lambda *report: reports.append(report))
    assert reports == [(done, 8) for done in range(9)]


def test_new_studies_get_folders_of_their_own(design, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    first = new_study_folder(design)
    assert first == tmp_path / "runs" / "study-paper-0"
    first.mkdir(parents=True)
    assert new_study_folder(design) == tmp_path / "runs" / "study-paper-0-2"
    led_away = replace(design, cells=[replace(cell, scenario="x/../../../zz") for cell in design.cells])
    assert new_study_folder(led_away).parent == tmp_path / "runs"


def test_a_table_of_many_metrics_is_read_in_one_piece_that_pandas_does_not_warn_of(tmp_path):
    path = tmp_path / "table.csv"
    names = [f"metric_{number}" for number in range(150)]
    path.write_text(",".join(names) + "\n" + ",".join(["1.5"] * len(names)) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_csv(path).assign(density=2.0)["density"].item() == 2.0
