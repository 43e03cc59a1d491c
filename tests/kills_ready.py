"""Imported by the process that victims are forked from: it solves and drives once, so that every kernel is loaded."""

import shutil
import tempfile
from pathlib import Path

from kills import A_FEW_CARS

from hj_cosim.run import run_episode
from hj_cosim.study import study  # noqa: F401  only loaded

with tempfile.TemporaryDirectory() as folder:
    specification = shutil.copy(Path(__file__).resolve().parent / "fixtures" / "highway_small.toml", folder)
    scenario = Path(folder) / "few.toml"
    scenario.write_text(A_FEW_CARS)
    run_episode(str(scenario), duration=1.0, table=str(specification), out=Path(folder) / "run")
