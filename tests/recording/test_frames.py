"""A run as one looks at it in a notebook: DataFrames, a line, a table."""

import numpy as np
import pandas as pd

from hj_cosim import read_run

HOSTILE = "<script>alert(1)</script>"


def test_a_run_has_the_tables_of_its_files(make_hostile_run, tmp_path):
    run = read_run(make_hostile_run(tmp_path / "run", HOSTILE))
    pd.testing.assert_frame_equal(run.robot, pd.read_parquet(run.folder / "robot.parquet"))
    pd.testing.assert_frame_equal(run.trajectories, pd.read_parquet(run.folder / "trajectories.parquet"))
    assert run.robot is run.robot
    robot = run.trajectories[run.trajectories["vehicle"] == "robot"]
    assert np.array_equal(robot["speed"], run.robot["speed"])


def test_a_run_tells_in_a_line_and_in_a_table_what_it_was(make_hostile_run, tmp_path):
    run = read_run(make_hostile_run(tmp_path / "run", HOSTILE))
    speed = run.robot["speed"].mean()
    assert repr(run).startswith(f"Run of {HOSTILE}, seed 7: hjop + spc (mi), 3 s, {speed:.4g} m/s, ")
    assert repr(run).endswith(f"ended by duration, in {run.folder}")
    html = run._repr_html_()
    assert f"<td>mean_speed</td><td>{speed:.4g}</td>" in html
    assert HOSTILE not in html
    assert "&lt;script&gt;" in html
