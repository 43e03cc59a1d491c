"""kill -9 while a study is driven, at any moment: going on with it ends in the bytes of one that nobody disturbed."""

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from hj_cosim.files import UNFINISHED
from hj_cosim.study.local_workers import LocalWorkers

# A study as a process of its own: its folder, how an episode is driven and what is asked for are arguments.
A_STUDY = """
import json, sys
from dataclasses import replace
from pathlib import Path
import synthetic_episodes
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.request import new_study, resumed_study
from hj_cosim.study.study import conduct

path, way, given = Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
resume = (path / "study.toml").is_file()
folder = StudyFolder.of(path, resumed_study(path, {}) if resume else new_study(given))
folder.begin({"hj-cosim": "1.0"}, resume=resume)
tables = dict.fromkeys(folder.tables, (replace(kept_table("highway"), path=path.parent / "table.npz"),))
print("begun", flush=True)
conduct(folder, LocalWorkers(2), function=getattr(synthetic_episodes, way), tables=tables)
"""

A_STUDY_OF_TWO_STACKS = {"episodes": 4, "stacks": ["hjop-spc-mi", "op-none"]}
A_SWEEP = {
    "episodes": 2,
    "stacks": ["hjop-spc-mi", "op-none"],
    "scenarios": ["light"],
    "vary": ["planner.gamma_r=0.8,0.9"],
}


@pytest.fixture
def start(synthetic, tmp_path):
    """Return a function that starts a study in a process of its own, and returns it when the folder is a study's."""
    path = os.pathsep.join([str(Path(synthetic.__file__).parent), *filter(None, sys.path)])

    def start_it(folder, way, given):
        command = [sys.executable, "-c", A_STUDY, str(folder), way, json.dumps(given)]
        process = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE)
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        return process

    return start_it


def kill(process):
    """End a study at once, and see that its workers end with it."""
    workers = []
    if process.poll() is None:
        workers = psutil.Process(process.pid).children()
        process.kill()
    process.wait()
    process.stdout.close()
    _, orphans = psutil.wait_procs(workers, timeout=60.0)
    assert not orphans


def test_what_a_killed_study_had_driven_is_kept(conduct_synthetic, reproducible_files, start, synthetic, tmp_path):
    reference = conduct_synthetic("reference")
    folder = tmp_path / "killed"
    process = start(folder, "drive_until_it_stalls", A_STUDY_OF_TWO_STACKS)
    # Seeds come first: both stacks drive seeds 0 and 1, and whatever comes after never ends.
    while len(list(folder.glob("episodes/*/[01]/summary.json"))) < 4:
        time.sleep(0.01)
    kill(process)
    # What a worker leaves that is cut short in the middle of writing.
    (folder / "episodes" / "op-none" / f".3{UNFINISHED}cut").mkdir(parents=True)
    done = sorted(folder.glob("episodes/*/*/robot.parquet"))
    assert [path.parent.name for path in done] == ["0", "1", "0", "1"]
    assert not (folder / "table.csv").exists()
    written = {path: path.stat().st_mtime_ns for path in done}

    reports = []
    resumed = conduct_synthetic("killed", LocalWorkers(2), resume=True, progress=lambda *report: reports.append(report))
    assert reproducible_files(resumed.folder) == reproducible_files(reference.folder)
    assert {path: path.stat().st_mtime_ns for path in done} == written
    assert not list(folder.glob("episodes/**/.*"))
    assert reports == [(done, 8) for done in range(4, 9)]


def test_a_sweep_of_two_stacks_killed_at_random_ends_the_same(conduct_synthetic, reproducible_files, start, tmp_path):
    given = {name: value if isinstance(value, int) else tuple(value) for name, value in A_SWEEP.items()}
    reference = conduct_synthetic("reference", **given)
    moments = random.Random(1)  # one early, one late
    folder = tmp_path / "killed"
    for _ in range(2):
        process = start(folder, "drive_slowly", A_SWEEP)
        time.sleep(moments.uniform(0.0, 2.5))  # some are killed while workers start, some over the tables
        kill(process)
    resumed = conduct_synthetic("killed", resume=True)
    assert resumed.missing == 0
    assert reproducible_files(resumed.folder) == reproducible_files(reference.folder)
