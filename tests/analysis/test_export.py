import gzip
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import sumolib.xml

from hj_cosim.analysis.export import export_files, export_run
from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.recording.run_folder import write_run
from hj_cosim.recording.study_files import OWN_FILES
from hj_cosim.scene.road import StraightRoad

FCD_NUMBERS = ("x", "y", "angle", "speed", "pos", "acceleration")
CONFIG = '[scenario]\nname = "synthetic"\n[scenario.network]\nedge = "high & way"\n'


@pytest.fixture
def run(tmp_path, make_record, monkeypatch):
    """Return the folder of a run on a turned road, in many row groups."""
    monkeypatch.setattr("hj_cosim.recording.trajectories.ROWS_PER_GROUP", 100)
    road = StraightRoad(lane_count=4, origin_x=30.0, origin_y=-14.0, heading=0.25)
    write_run(tmp_path / "run", make_record(samples=90, road=road), CONFIG, {})
    return tmp_path / "run"


def trajectories(folder) -> pd.DataFrame:
    table = pd.read_parquet(folder / "trajectories.parquet")
    return table.assign(vehicle=table.vehicle.astype("str"))


def test_csv_reads_back_with_every_car_step_and_value(run):
    types = {"lane": "int8", "length": float, "width": float}
    written = pd.read_csv(export_run(run, "csv"), dtype=types, float_precision="round_trip")
    pd.testing.assert_frame_equal(written, trajectories(run), rtol=1e-15, atol=0.0)


def test_parquet_reads_back_with_plain_names(run, tmp_path):
    written = pd.read_parquet(export_run(run, "parquet", tmp_path / "plain.parquet"))
    assert not isinstance(written.vehicle.dtype, pd.CategoricalDtype)
    pd.testing.assert_frame_equal(written.assign(vehicle=written.vehicle.astype("str")), trajectories(run))


def test_fcd_reads_back_with_sumo_s_own_reader(run):
    path = export_run(run, "fcd")
    rows = [
        (float(step.time), car.id, *(float(getattr(car, key)) for key in FCD_NUMBERS), car.lane)
        for step in sumolib.xml.parse(str(path), "timestep")
        for car in step.vehicle
    ]
    written = pd.DataFrame(rows, columns=["time", "vehicle", *FCD_NUMBERS, "lane"])
    expected = trajectories(run)

    np.testing.assert_allclose(written.time, expected.time, atol=1e-9)
    assert written.vehicle.tolist() == expected.vehicle.tolist()
    np.testing.assert_array_equal(written.speed, expected.speed)
    np.testing.assert_array_equal(written.acceleration, expected.acceleration)
    assert written.lane.tolist() == [f"high & way_{lane}" for lane in expected.lane]
    # The road starts at (30, −14) and is turned by 0.25: back from the front bumper to the centre in the road's frame.
    heading = np.radians(90.0 - written.angle) - 0.25
    dx, dy = written.x - 30.0, written.y + 14.0
    along = dx * math.cos(0.25) + dy * math.sin(0.25)
    aside = -dx * math.sin(0.25) + dy * math.cos(0.25)
    np.testing.assert_allclose(np.arctan2(np.sin(heading), np.cos(heading)), expected.heading, atol=1e-12)
    np.testing.assert_allclose(along - 2.5 * np.cos(heading), expected.x, atol=1e-9)
    np.testing.assert_allclose(aside - 2.5 * np.sin(heading), expected.y, atol=1e-9)
    np.testing.assert_allclose(written.pos, along, atol=1e-9)


def test_what_cannot_be_exported_is_named(run, tmp_path):
    with pytest.raises(OutputError, match="choose one of csv, parquet, fcd"):
        export_run(run, "xlsx")
    with pytest.raises(RunFolderError, match="holds no run"):
        export_run(tmp_path, "csv")


@pytest.mark.parametrize(
    ("name", "begins"),
    [("d.csv", b'"time"'), ("d.parquet", b"PAR1"), ("d.fcd.xml", b"<?xml"), ("d.xml", b"<?xml")],
)
def test_name_of_the_file_says_what_is_exported(run, tmp_path, name, begins):
    assert export_run(run, None, tmp_path / name).read_bytes().startswith(begins)


@pytest.mark.parametrize("name", ["d.csv", "d.fcd.xml"])
def test_name_that_ends_in_gz_is_the_same_compressed(run, tmp_path, name):
    plain = export_run(run, None, tmp_path / name)
    compressed = export_run(run, None, tmp_path / f"{name}.gz")
    assert gzip.decompress(compressed.read_bytes()) == plain.read_bytes()
    again = export_run(run, None, tmp_path / "again" / f"{name}.gz")
    assert again.read_bytes() == compressed.read_bytes()


@pytest.mark.parametrize(
    ("format", "name", "said"),
    [
        ("csv", "d.fcd.xml", "--format csv contradicts the name .*d.fcd.xml, which is that of fcd"),
        ("fcd", "d.csv.gz", "contradicts"),
        (None, "d.txt", "does not say what to export; give it with --format"),
        (None, "d.gz", "does not say what to export"),
        (None, "d.csv.zst", "only gzip compresses an export"),
        ("parquet", "d.parquet.gz", "Parquet is compressed within"),
    ],
)
def test_name_that_promises_what_is_not_written_is_refused(run, tmp_path, format, name, said):
    with pytest.raises(OutputError, match=said):
        export_run(run, format, tmp_path / name)
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(
    ("format", "name"),
    [
        *(("csv", "mine.py"), ("parquet", "scenario.toml"), ("csv", "notes"), ("fcd", "a.sumocfg")),
        *(("fcd", "a.net.xml"), ("fcd", "a.rou.xml.gz"), ("csv", "mine.txt.gz")),
    ],
)
def test_export_takes_the_place_of_no_file_whose_name_is_not_an_exports(run, tmp_path, format, name):
    mine = tmp_path / name
    mine.write_text("mine")
    with pytest.raises(OutputError, match="is there already, and its name is not one that exports have"):
        export_run(run, format, mine)
    assert mine.read_text() == "mine"
    mine.unlink()
    assert export_run(run, format, mine) == mine  # a new file may have any name


def test_export_takes_the_place_of_an_earlier_one(run, tmp_path):
    for format, name in (("csv", "a.v2.csv.gz"), ("parquet", "a.parquet"), ("fcd", "a.fcd.xml"), ("fcd", "a.xml")):
        assert export_run(run, format, tmp_path / name) == export_run(run, format, tmp_path / name)


def test_export_never_takes_the_place_of_what_a_run_recorded(run, tmp_path, monkeypatch):
    before = {path: path.read_bytes() for path in run.iterdir() if path.is_file()}
    (tmp_path / "link").symlink_to(run)
    monkeypatch.chdir(run)
    own = [*before, run / "figures", run / "timing.json", tmp_path / "link" / "robot.parquet", Path("summary.json")]
    for path in own:
        format = "parquet" if path.suffix == ".parquet" else "csv"
        with pytest.raises((RunFolderError, OutputError), match="belongs to the run in"):
            export_run(run, format, path)
    assert {path: path.read_bytes() for path in run.iterdir() if path.is_file()} == before
    assert export_run(run, "parquet").name == "trajectories.plain.parquet"


def test_export_never_takes_the_place_of_what_a_study_found(run, tmp_path, monkeypatch):
    study = tmp_path / "study"
    study.mkdir()
    for name in OWN_FILES:
        (study / name).write_text("found")
    monkeypatch.chdir(study)
    for path in (*(study / name for name in OWN_FILES if name != "study.toml"), Path("table.csv")):
        with pytest.raises(RunFolderError, match=r"belongs to the study in .*; choose another name with --out"):
            export_run(run, None, path)
    assert {path.read_text() for path in study.iterdir()} == {"found"}
    assert export_run(run, None, study / "mine.csv").exists()
    (tmp_path / "table.csv").write_text("of nobody's study")
    assert export_run(run, None, tmp_path / "table.csv").read_bytes().startswith(b'"time"')


@pytest.mark.parametrize("is_named_file_there", [False, True])
def test_fcd_export_leaves_a_file_beside_it_that_is_another_s(run, tmp_path, is_named_file_there):
    beside = tmp_path / "d.types.add.xml"
    beside.write_text("<additional/>")
    if is_named_file_there:
        (tmp_path / "d.fcd.xml").write_text("older")
    with pytest.raises(OutputError, match=r"d\.types\.add\.xml would be written beside it, but is there already"):
        export_run(run, None, tmp_path / "d.fcd.xml")
    assert beside.read_text() == "<additional/>"
    assert (tmp_path / "d.fcd.xml").exists() == is_named_file_there


@pytest.mark.parametrize("name", ["07_tracksMeta.csv", "07_recordingMeta.csv"])
def test_highd_export_leaves_a_file_beside_it_that_is_another_s(run, tmp_path, name):
    beside = tmp_path / name
    beside.write_text("mine")
    with pytest.raises(OutputError, match=f"{beside.name} would be written beside it, but is there already"):
        export_run(run, "highd", tmp_path / "07_tracks.csv")
    assert [path.name for path in tmp_path.glob("07_*")] == [beside.name]
    assert beside.read_text() == "mine"


def test_a_repeated_export_replaces_all_of_its_files(run, tmp_path):
    (run / "config.toml").write_text(CONFIG + "[simulation]\nstep = 0.02\n")
    for format, name in (("fcd", "d.fcd.xml"), ("highd", "07_tracks.csv")):
        first = {path: path.read_bytes() for path in export_files(run, format, tmp_path / name)}
        again = {path: path.read_bytes() for path in export_files(run, format, tmp_path / name)}
        assert again == first
