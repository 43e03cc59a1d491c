import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pyarrow.parquet as pq
import pytest

from hj_cosim.errors import RunFolderError
from hj_cosim.files import UNFINISHED
from hj_cosim.study.design import design_study, parse_variation
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.stacks import Stack
from hj_cosim.study.study import new_study_folder, write_tables

STACKS = (Stack("hjop", "spc", "mi"), Stack("op", "none"))

# A study as a process of its own, to be killed: the folder, the table's file and the engine's size are arguments.
A_STUDY = """
import sys
from pathlib import Path
import synthetic_episodes
from hj_cosim.study.design import design_study
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.stacks import Stack
from hj_cosim.study.study import conduct

design = design_study(episodes=4, stacks=(Stack("hjop", "spc", "mi"), Stack("op", "none")))
folder = StudyFolder(Path(sys.argv[1]), design)
conduct(folder, LocalWorkers(2), request={"asked": "for"}, program={"hj-cosim": "1.0"},
        function=synthetic_episodes.drive_slowly, table_files={"highway": Path(sys.argv[2])})
"""


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
    study = conduct_synthetic("study", study=design_study(episodes=1, stacks=STACKS[1:]))
    assert pd.read_csv(study.folder / "differences.csv").empty
    assert pd.read_csv(study.folder / "claims.csv").empty


def test_the_papers_numbers_stand_beside_ours(conduct_synthetic):
    comparison = conduct_synthetic("study").comparison
    assert list(comparison["mean_speed_paper"]) == [22.0, 28.141]
    assert list(comparison["ttc_ge_3_paper"]) == [0.999, 0.502]


def test_a_sweep_has_columns_for_what_varies_and_compares_one_factor_at_a_time(conduct_synthetic):
    study = design_study(
        ("light", "paper"), episodes=1, stacks=STACKS, variations=(parse_variation("planner.gamma_r=0.8,0.9"),)
    )
    swept = conduct_synthetic("study", study=study)
    assert len(swept.table) == 8
    assert list(swept.table["planner.gamma_r"].unique()) == [0.8, 0.9]
    # Each of the 8 rows has one neighbour in each of the three factors.
    assert len(swept.differences) == 8 * 3 // 2
    assert (swept.folder / "episodes" / "light" / "planner.gamma_r=0.8" / "op-none" / "0" / "summary.json").is_file()


def test_the_files_are_the_same_for_any_number_of_workers(conduct_synthetic, reproducible_files):
    reference = conduct_synthetic("reference")
    for workers in (1, 3):
        other = conduct_synthetic(f"of {workers}", LocalWorkers(workers))
        assert reproducible_files(reference.folder) == reproducible_files(other.folder)


def test_a_study_that_was_killed_is_resumed_and_ends_the_same(
    conduct_synthetic, reproducible_files, synthetic, tmp_path
):
    reference = conduct_synthetic("reference")
    folder = tmp_path / "killed"
    path = os.pathsep.join([str(Path(synthetic.__file__).parent), *filter(None, sys.path)])
    process = subprocess.Popen(
        [sys.executable, "-c", A_STUDY, str(folder), str(tmp_path / "table.npz")],
        env={**os.environ, "PYTHONPATH": path},
    )
    deadline = time.monotonic() + 120.0
    while len(list(folder.glob("episodes/*/*/summary.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    workers = psutil.Process(process.pid).children()
    process.send_signal(signal.SIGKILL)
    process.wait()
    _, orphans = psutil.wait_procs(workers, timeout=60.0)
    assert not orphans
    # What a worker leaves that is cut short in the middle of writing.
    (folder / "episodes" / "op-none" / f".3{UNFINISHED}cut").mkdir(parents=True)
    done = [path.parent for path in folder.glob("episodes/*/*/summary.json")]
    assert 2 <= len(done) < 8
    assert not (folder / "table.csv").exists()
    written = {path: (path / "robot.parquet").stat().st_mtime_ns for path in done}

    reports = []
    resumed = conduct_synthetic("killed", LocalWorkers(2), resume=True, progress=lambda *report: reports.append(report))
    assert reproducible_files(resumed.folder) == reproducible_files(reference.folder)
    assert {path: (path / "robot.parquet").stat().st_mtime_ns for path in done} == written
    assert not list(folder.glob("episodes/**/.*"))
    assert reports[0][0] >= len(done)
    assert reports[-1] == (8, 8)


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
    unlucky = design_study(episodes=1, seed=synthetic.UNLUCKY_SEED, stacks=STACKS)
    study = conduct_synthetic("study", study=unlucky, function=synthetic.drive_or_fail)
    assert list(study.table["episodes"]) == [1, 0]
    assert np.isnan(study.table["mean_speed"].iloc[1])


def test_a_resumed_study_may_get_more_episodes(conduct_synthetic, reproducible_files):
    longer = design_study(episodes=6, stacks=STACKS)
    reference = conduct_synthetic("reference", study=longer)
    conduct_synthetic("study")
    grown = conduct_synthetic("study", study=longer, resume=True)
    assert reproducible_files(grown.folder) == reproducible_files(reference.folder)


def test_another_study_is_not_mixed_into_a_folder(conduct_synthetic):
    folder = conduct_synthetic("study").folder
    other = design_study(episodes=4, stacks=STACKS, assignments=("filter.epsilon=5",))
    before = (folder / "study.toml").read_bytes()
    with pytest.raises(RunFolderError, match=r"another configuration .* filter\.epsilon was 2\.0 and is 5"):
        conduct_synthetic("study", study=other, resume=True)
    assert (folder / "study.toml").read_bytes() == before


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
    for resume in (False, True):
        with pytest.raises(RunFolderError, match="is not empty"):
            conduct_synthetic("other", resume=resume)
    assert (tmp_path / "other" / "notes.txt").read_text() == "mine"


def test_a_broken_run_folder_is_named(conduct_synthetic, design):
    study = conduct_synthetic("study")
    broken = study.folder / "episodes" / "op-none" / "2"
    (broken / "robot.parquet").write_bytes(b"PAR1")
    with pytest.raises(RunFolderError, match=r"op-none/2 holds no readable run .*remove it and --resume"):
        write_tables(StudyFolder(study.folder, design))


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
