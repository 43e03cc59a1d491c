"""Run and study folders that somebody made to harm or by accident: refused in a sentence that names the bound."""

import json
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomli_w

from hj_cosim.analysis.export import export_run
from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.run_table import table_of
from hj_cosim.analysis.figures.style import save_drawing
from hj_cosim.analysis.report import write_report
from hj_cosim.errors import RunFolderError, TableError
from hj_cosim.metrics.summary import summarize
from hj_cosim.recording import run_bounds
from hj_cosim.recording.run_folder import Run, read_run, write_run

MEGABYTE = 2**20


@pytest.fixture
def folder(tmp_path, record, config) -> Path:
    """Return the folder of a good run."""
    text = tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))
    write_run(tmp_path / "run", record, text, summarize(record, config))
    return tmp_path / "run"


def changed(path: Path, change: Callable[[pa.Table], pa.Table]) -> None:
    pq.write_table(change(pq.read_table(path)), path)


def with_column(name: str, value: Callable[[pa.Table], object]) -> Callable[[pa.Table], pa.Table]:
    return lambda rows: rows.set_column(rows.schema.get_field_index(name), name, [value(rows)])


def spoilt(name: str, bad: float) -> Callable[[pa.Table], pa.Table]:
    def value(rows: pa.Table) -> pa.Array:
        column = rows[name].to_numpy().copy()
        column[5] = bad
        return pa.array(column)

    return with_column(name, value)


def road(**changes: object) -> Callable[[pa.Table], pa.Table]:
    def change(rows: pa.Table) -> pa.Table:
        stated = json.loads(rows.schema.metadata[b"hj_cosim.road"]) | changes
        return rows.replace_schema_metadata({b"hj_cosim.road": json.dumps(stated).encode()})

    return change


# Each case: which file, what becomes of its table, and what the answer must say.
TABLES: dict[str, tuple[str, Callable[[pa.Table], pa.Table], str]] = {
    "no rows": ("robot", lambda rows: rows.slice(0, 0), "has no rows"),
    "no time": ("robot", lambda rows: rows.drop_columns("time"), "time"),
    "no plan": ("robot", lambda rows: rows.drop_columns("plan_lane"), "plan_lane"),
    "no threats": ("robot", lambda rows: rows.drop_columns("ttc"), "ttc"),
    "a text for a number": ("robot", with_column("x", lambda rows: pa.array(["a"] * len(rows))), "must be of numbers"),
    "lists for numbers": ("robot", with_column("x", lambda rows: pa.array([[1.0]] * len(rows))), "must be of numbers"),
    "no number at all": ("robot", with_column("x", lambda rows: pa.nulls(len(rows), pa.float64())), "without a number"),
    "NaN for a place": ("robot", spoilt("x", np.nan), "column x has what is not finite"),
    "infinity for a speed": ("robot", spoilt("speed", np.inf), "column speed has what is not finite"),
    "time that stands": ("robot", spoilt("time", 0.0), "times are not finite and growing"),
    "an unknown vehicle": (
        "robot",
        with_column("value_vehicle", lambda rows: pa.array([str(i) for i in range(len(rows))]).dictionary_encode()),
        "names a vehicle that",
    ),
    "names as numbers": ("trajectories", with_column("vehicle", lambda rows: pa.array(range(len(rows)))), "dictionary"),
    "no vehicle": ("trajectories", lambda rows: rows.drop_columns("vehicle"), "vehicle"),
    "no lane": ("trajectories", lambda rows: rows.drop_columns("lane"), "lane"),
    "NaN for a car": ("trajectories", spoilt("y", np.nan), "column y has what is not finite"),
    "a car beyond the world": ("trajectories", spoilt("x", 1e300), "beyond 1e+07"),
    "other times": ("trajectories", spoilt("time", 1e6), "out of bounds"),
    "no road": ("trajectories", lambda rows: rows.replace_schema_metadata(None), "what road"),
    "a road of a billion lanes": ("trajectories", road(lane_count=10**9), "1000000000 lanes"),
    "a road without width": ("trajectories", road(lane_width=0.0), "lanes of 0.0 m"),
    "a road of words": ("trajectories", road(length="long"), "length"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_strange_table_is_refused_in_a_sentence(folder, case):
    name, change, said = TABLES[case]
    changed(folder / f"{name}.parquet", change)
    with pytest.raises(RunFolderError, match="holds no readable run") as refused:
        read_run(folder)
    assert said in str(refused.value)
    assert str(folder) in str(refused.value)


@pytest.mark.parametrize(
    ("format", "case"),
    [
        *((format, case) for format in ("csv", "parquet", "fcd") for case in ("no vehicle", "no lane", "no rows")),
        ("csv", "names as numbers"),
        ("fcd", "no road"),  # the others are not in world coordinates
    ],
)
def test_a_strange_table_is_not_exported(folder, tmp_path, format, case):
    changed(folder / "trajectories.parquet", TABLES[case][1])
    with pytest.raises(RunFolderError, match=r"trajectories\.parquet is broken"):
        export_run(folder, format, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_billion_rows_in_some_kilobytes_are_refused_before_memory_is_taken(folder):
    large = pa.table({"time": np.zeros(2**22)})
    with pq.ParquetWriter(folder / "robot.parquet", large.schema) as writer:
        for _ in range(30):
            writer.write_table(large, row_group_size=2**20)
    before = pa.total_allocated_bytes()
    tracemalloc.start()
    with pytest.raises(RunFolderError, match=r"robot\.parquet has 125829120 rows; 1000000 is the most"):
        read_run(folder)
    assert tracemalloc.get_traced_memory()[1] < 16 * MEGABYTE
    tracemalloc.stop()
    assert pa.total_allocated_bytes() - before < 16 * MEGABYTE


@pytest.mark.parametrize(
    ("bound", "value", "said"),
    [
        ("MOST_ROWS_AT_ONCE", 10, "10 and 268435456 are the most"),
        ("MOST_BYTES_AT_ONCE", 100, "and 100 are the most"),
        ("MOST_SAMPLES", 20, "20 is the most"),
        ("MOST_CELLS", 50, "50 of both together is the most"),
    ],
)
def test_each_bound_is_named(folder, monkeypatch, bound, value, said):
    monkeypatch.setattr(run_bounds, bound, value)
    with pytest.raises(RunFolderError, match="holds no readable run") as refused:
        read_run(folder)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("summary.json", "[]", "is no summary"),
        ("summary.json", "{}", "is no summary"),
        ("summary.json", "[" * 100_000, "nested too deeply"),
        ("summary.json", '"' + "x" * 2_000_000 + '"', "too large; 1 MB is the most"),
        ("summary.json", '{"scenario": [], "planner": 1, "filter": 1, "scheme": 1, "seed": 1}', "one number or text"),
        ("config.toml", "x = " + "[" * 4000, "within each other"),
        ("config.toml", "a" + ".a" * 50_000 + " = 1", "line 1 has 100005 characters; 5000 is the most"),
        ("config.toml", "# " + "x" * 2_000_001, "too large; 2 MB of TOML is the most"),
        ("config.toml", "seed = " + "9" * 4900, "is not TOML"),
        ("config.toml", "seed = 1", "scenario: field required"),
        ("config.toml", '[scenario]\nname = "a"\ncolour = "red"', "unknown key 'scenario.colour'"),
    ],
)
def test_a_strange_text_is_refused_in_a_sentence(folder, name, content, said):
    (folder / name).write_text(content)
    with pytest.raises(RunFolderError, match=name) as refused:
        read_run(folder)
    assert said in str(refused.value)
    assert len(str(refused.value)) < 600


def test_a_python_file_that_a_run_s_table_names_is_not_run(folder, tmp_path):
    (tmp_path / "game.toml").write_text('dynamics = "game.py"\n')
    (tmp_path / "game.py").write_text(f"open({str(tmp_path / 'proof')!r}, 'w')\n")
    run = read_run(folder)
    with pytest.raises(TableError, match=r"game\.py, which is not run because a run's folder says so"):
        table_of(Run(run.folder, {**run.config, "table": str(tmp_path / "game.toml")}, run.summary, run.record))
    assert not (tmp_path / "proof").exists()


METRICS = (
    "ttc_ge_3",
    "ttc_p1",
    "ttc_p10",
    "ttc_2d_p1",
    "btn_le_1",
    "mean_speed",
    "mean_abs_acceleration",
    "intervention_percent",
)


@pytest.fixture
def study(tmp_path) -> Path:
    """Return a study's folder with hostile names in it."""
    stack = {"scenario": "$\\frac{ ../../x </script>", "planner": "$x_{", "filter": "spc", "scheme": "mi"}
    rows = [stack | {"episodes": 2, "missing": 0} | {f"{m}{e}": 1.0 for m in METRICS for e in ("", "_lo", "_hi")}]
    pd.DataFrame(rows).to_csv(tmp_path / "table.csv", index=False)
    return tmp_path


def test_names_that_look_like_formulas_or_tags_are_drawn_and_escaped(study):
    page = write_report(study).read_text()
    assert "<td>$\\frac{ ../../x &lt;/script&gt;</td>" in page
    assert save_drawing(draw_figure("trade-off", study=study), study / "a.png") == [study / "a.png"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda table: table.drop(columns="ttc_2d_p1_lo"), "has no column ttc_2d_p1_lo"),
        (lambda table: table.assign(ttc_2d_p1="low"), "column ttc_2d_p1 must be of numbers"),
        (lambda table: table.drop(columns="scenario"), "has no column scenario"),
    ],
)
def test_a_strange_study_is_refused_in_a_sentence(study, change, said):
    change(pd.read_csv(study / "table.csv")).to_csv(study / "table.csv", index=False)
    with pytest.raises(RunFolderError, match="holds no complete study") as refused:
        write_report(study)
    assert said in str(refused.value)
    assert "table.csv" in str(refused.value)


def test_a_density_sweep_of_a_study_without_its_episodes_is_refused(study):
    with pytest.raises(RunFolderError, match="it has no episode of scenario"):
        draw_figure("density-sweep", study=study)
