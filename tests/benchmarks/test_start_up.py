"""How long people wait for what the command line answers, each beside the imports that it cannot do without.

Wall times, of which the shortest of several counts. On a machine that does other things they are longer; then the
processor times that are printed beside them are fairer.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIMES = 5


def seconds(*arguments: str) -> float:
    """Return what a call of Python takes, the shortest of several; modules are compiled once, as for any user."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    taken, worked = [], []
    for _ in range(TIMES + 1):
        started, before = time.perf_counter(), _processor_time()
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=environment)
        taken.append(time.perf_counter() - started)
        worked.append(_processor_time() - before)
    print(f"\n{min(taken[1:]):.2f} s, of the processor {min(worked[1:]):.2f} s: {' '.join(arguments)[:90]}")
    return min(taken[1:])


def _processor_time() -> float:
    """Return the processor time of the processes that have been waited for, s."""
    times = os.times()
    return times.children_user + times.children_system


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run of 30 s to draw from, which leaves behind every kernel that the next one needs."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    subprocess.run([sys.executable, "-m", "hj_cosim", "run", "--out", str(folder)], check=True, capture_output=True)
    return folder


def test_a_list_of_scenarios(row):
    row("scenarios", seconds("-m", "hj_cosim", "scenarios"), seconds("-c", "import numpy, pydantic"))


def test_a_figure(row, run, tmp_path):
    floor = seconds("-c", "import matplotlib.figure, matplotlib.backends.backend_agg")
    drawn = seconds("-m", "hj_cosim", "figure", "timeline", "--run", str(run), "--out", str(tmp_path / "timeline"))
    row("figure", drawn, floor)
    for name, *source in (("snapshots", "--run", str(run)), ("highway", "--run", str(run)), ("value-slice",)):
        seconds("-m", "hj_cosim", "figure", name, *source, "--out", str(tmp_path / name))


def test_a_warm_run(row, run):
    floor = seconds("-c", "import numba, libsumo, matplotlib.figure, matplotlib.backends.backend_agg")
    again = run.with_name("again")
    program = "import shutil, sys; shutil.rmtree(sys.argv[-1], True); from hj_cosim.cli.entry import main; main()"
    row("run", seconds("-c", program, "run", "--out", str(again)), floor)


def test_make_run_on_a_fresh_machine(row, tmp_path):
    """From a fresh clone with empty caches, installation included; needs a package index."""
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    home = tmp_path / "home"
    home.mkdir()
    environment = {"PATH": os.environ["PATH"], "HOME": str(home)}
    started = time.perf_counter()
    done = subprocess.run(["make", "run"], cwd=clone, env=environment, capture_output=True, text=True, check=False)
    taken = time.perf_counter() - started
    assert done.returncode == 0, done.stderr
    row("make run", taken)
    shutil.rmtree(clone)
