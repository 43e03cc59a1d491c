"""What a user can get wrong: every case ends in one sentence that names it, exit status 2, and nothing written."""

import shutil
import sys

import pytest

from hj_cosim.cli.commands import main
from hj_cosim.locations import specifications_folder
from hj_cosim.reachability.table.store import save_table

# What a study.toml has, but for the versions of the program.
A_STUDY = """
scenarios = ["paper"]
stacks = ["hjop-spc-mi"]
episodes = 40
seed = 0
preset = "best"
vary = []
set = []
keep = "all"
"""

# Each case: what --set is given, and what the answer must name beside the key and the value.
ASSIGNMENTS = {
    "seed=-1": "greater than or equal to 0",
    "seed=1.5": "valid integer",
    "seed=one": "valid integer",
    "preset=bst": "'best' or 'paper'",
    "sed=3": "unknown key 'sed'",
    "robot.length=0": "greater than or equal to 0.1",
    "robot.width=-2": "greater than or equal to 0.1",
    "robot.wheelbase=0": "greater than or equal to 0.1",
    "robot.omega_max=0": "greater than or equal to 0.001",
    "robot.omega_max=1e-200": "greater than or equal to 0.001",
    "robot.acceleration_min=1": "less than or equal to -0.01",
    "robot.acceleration_max=0": "greater than or equal to 0.01",
    "robot.acceleration_max=1e300": "less than or equal to 100",
    "robot.speed_max=inf": "finite number",
    "robot.wheels=4": "unknown key 'robot.wheels'",
    "tracking.k_theta=0": "greater than 0",
    "tracking.k_1=nan": "finite number",
    "tracking.k_3=1": "unknown key 'tracking.k_3'",
    "planner.kind=dijkstra": "choose one of hjop, op, mppi, idle",
    "planner.gamma_r=1.1": "less than or equal to 1",
    "planner.gamma_r=-0.1": "greater than or equal to 0",
    "planner.value_clip=0": "greater than 0",
    "planner.expansions=0": "greater than or equal to 1",
    "planner.expansions=1e9": "less than or equal to",
    "planner.expansions=2.5": "valid integer",
    "planner.discount=1": "less than 1",
    "planner.discount=0": "greater than 0",
    "planner.speed_low=40": "must exceed speed_low",
    "planner.speed_step=0": "greater than 0",
    "planner.sensing_range=-5": "greater than 0",
    "planner.budget=10": "unknown key 'planner.budget'",
    "planner=fast": "planner",
    "filter.kind=cbf": "choose one of spc, rss, none",
    "filter.scheme=both": "'mi' or 'sw'",
    "filter.epsilon=-1": "greater than or equal to 0",
    "filter.slack_weight=0": "greater than 0",
    "filter.solver=gurobi": "'daqp'",
    "filter.rss.response_time=-1": "greater than or equal to 0",
    "filter.rss.brake_min=0": "greater than 0",
    "filter.rss.brake=4": "unknown key 'filter.rss.brake'",
    "simulation.duration=0": "greater than 0",
    "simulation.duration=1e9": "less than or equal to 3600",
    "simulation.step=0": "greater than or equal to 0.001",
    "simulation.step=1e-300": "greater than or equal to 0.001",
    "simulation.settle_time=1e300": "less than or equal to 3600",
    "simulation.plan_period=1e300": "less than or equal to 3600",
    "planner.prediction_step=1e-9": "must be at least action_time",
    "planner.action_time=1e300": "must be at least action_time",
    "seed=9223372036854775808": "seed",
    "simulation.step=1": "less than or equal to 0.1",
    "simulation.plan_period=-1": "greater than 0",
    "scenario.rogues.share=1.5": "scenario.rogues.share = 1.5",
    "scenario.rogues.limits.braking=0": "scenario.rogues.limits.braking = 0",
    "scenario.rogues.behaviour=polite": "choose one of cut_in, brake_check, tailgate, drift, block, worst, mixed, or",
    "scenario.rogues.options={ gap = 3.0 }": "options are one behaviour's own",
    "simulation.settle_time=-1": "greater than or equal to 0",
    "simulation.on_collision=explode": "'stop' or 'continue'",
    "scenario.traffic.count=-1": "greater than or equal to 0",
    "scenario.traffic.count=100000": "less than or equal to 5000",
    "scenario.traffic.spacing_factor=0": "greater than 0",
    "scenario.traffic.spacing_jitter=1": "less than 1",
    "scenario.traffic.speed_low=50": "must be at least speed_low",
    "scenario.traffic.cars=3": "unknown key 'scenario.traffic.cars'",
    "scenario.drivers.desired_speed.mean=0": "greater than 0",
    "scenario.drivers.desired_speed.deviation=20": "reaches zero",
    "scenario.drivers.desired_speed.truncation=1e-9": "greater than or equal to 0.1",
    "scenario.drivers.desired_speed=23": "scenario.drivers.desired_speed",
    "scenario.drivers.politeness=2": "less than or equal to 1",
    "scenario.drivers.safe_braking=0": "greater than 0",
    "scenario.robot.lane=-1": "greater than or equal to 0",
    "scenario.robot.speed=-1": "greater than or equal to 0",
    "scenario.robot.line=1": "unknown key 'scenario.robot.line'",
    "table=": "no table specification is called ''",
    "table=no_such_table": "choose one of",
    "planner.gamma_r": "write KEY=VALUE",
    "=1": "write KEY=VALUE",
    "planner.=1": "write KEY=VALUE",
}

# Each case: a scenario's TOML, and what the answer must name.
SCENARIOS = {
    "seed = ": "is not TOML",
    "colour = 'red'": "unknown key",
    "[traffic]\ncount = 'many'": "count = 'many'",
    "[traffic]\ndensity = 13\nspacing_factor = 2.0": "say the same thing twice",
    "[network]\nfile = 'absent.net.xml'": "absent.net.xml",
    "[network]\nedge = 'lowway'": "lowway",
    "[robot]\nlane = 9": "lanes 0 to 3",
    "[traffic]\ndensity = 500": "do not fit",
    "[traffic]\ncount = 5000": "but the road is",
    "[[cars]]\nlane = 0": "x",
    "[[cars]]\nlane = 1\nx = 1.0\nspeed = 20.0": "overlap",
    "[[cars]]\nlane = 7\nx = 30.0\nspeed = 20.0": "lanes 0 to 3",
}

# Each case: a change to value_tables/highway.toml (old, new), and what the answer must name.
SPECIFICATIONS = {
    ('dynamics = "highway"', 'dynamics = "lowway"'): "lowway",
    ('dynamics = "highway"', 'dynamics = "absent.py"'): "absent.py",
    ('scheme = "weno5"', 'scheme = "weno7"'): "'first_order', 'eno2', 'weno3' or 'weno5'",
    ("horizon = 3.0", "horizon = -3.0"): "greater than 0",
    ("horizon = 3.0", "horizon = 3.0\nhorizn = 2.0"): "unknown key 'horizn'",
    ("[grid]", "[gird]"): "grid",
    ("-0.4, 0.0, 0.0]", "-0.4, 0.0]"): "one entry per axis",
    ("horizon = 3.0", "horizon = 3.0\ncfl = 2.0"): "less than or equal to 1",
    ("horizon = 3.0", "horizon = 3.0\nmargin = -1.0"): "greater than or equal to 0",
    ("horizon = 3.0", "horizon = 3.0\nrunge_kutta = 4"): "1, 2 or 3",
    ("[parameters]", "[parameters]\nfriction = 1.0"): "friction",
    ("capped_by_manoeuvres = true", "capped_by_manoeuvres = 'yes please'"): "capped_by_manoeuvres",
}

# Each case: arguments, and what the answer must name. FILE is a file, EMPTY an empty folder, FULL one with a file,
# STRANGE and STUDY a run's and a study's folder with other things in their files, BEGUN that of an unfinished study.
COMMANDS = {
    ("run", "no_such_scenario"): "choose one of",
    ("run", "absent.toml"): "absent.toml does not exist",
    ("run", "--out", "FULL"): "is not empty; choose another --out",
    ("run", "--out", "FILE"): "is a file, a run needs a folder",
    ("run", "--out", "FILE/run"): "FILE/run",
    ("study", "--episodes", "0"): "episodes",
    ("study", "--stack", "hjop-spc"): "no stack is called 'hjop-spc'",
    ("run", "--record", "everything"): "input should be 'near' or 'all'",
    ("run", "--traffic", "mine"): "input should be 'theirs' or 'idm-mobil'",
    ("study", "--traffic", "mine"): "input should be 'theirs' or 'idm-mobil'",
    ("study", "--vary", "planner.gamma_r"): "planner.gamma_r",
    ("study", "--vary", "planner.gamma=0.5,0.6"): "unknown key 'planner.gamma'",
    ("study", "paper,papr"): "no scenario is called 'papr'",
    ("study", "--workers", "0"): "workers",
    ("table", "show", "no_such_table"): "choose one of",
    ("table", "check", "no_such_table"): "choose one of",
    ("table", "solve", "highway", "--shape", "21"): "--out",
    ("table", "solve", "highway", "--shape", "21", "--out", "x.npz"): "one entry per axis",
    ("table", "solve", "highway", "--scheme", "weno9", "--out", "x.npz"): "'first_order', 'eno2', 'weno3' or 'weno5'",
    ("figure", "no-such-figure"): "choose one of",
    ("figure", "timeline"): "--run",
    ("figure", "trade-off"): "--study",
    ("figure", "timeline", "--run", "EMPTY"): "holds no run",
    ("figure", "trade-off", "--study", "EMPTY"): "holds no complete study",
    ("export", "EMPTY"): "holds no run",
    ("export", "absent", "--format", "csv"): "absent",
    ("export", "EMPTY", "--format", "xlsx"): "choose one of csv, parquet, fcd",
    ("replay", "EMPTY"): "holds no run",
    ("replay", "absent"): "is not a folder",
    ("report", "EMPTY"): "holds neither a run nor a study",
    ("report", "absent"): "holds neither a run nor a study",
    ("run", "--preset", "bst"): "choose one of best, paper",
    ("run", "--seed", "-1"): "seed = -1",
    ("run", "--duration", "nan"): "simulation.duration = nan",
    ("run", "--planner", "dijkstra"): "choose one of hjop, op, mppi, idle",
    ("run", "--table", "absent.toml"): "absent.toml does not exist",
    ("study", "--seed", "-1"): "seed",
    ("study", "--preset", "bst"): "choose one of best, paper",
    ("study", "--set", "planner.gamma_r=2"): "planner.gamma_r = 2",
    ("study", "--vary", "seed=1,2"): "a study sets seed itself",
    ("study", "--out", "FULL"): "is not empty",
    ("study", "--scenario", "absent.toml"): "absent.toml does not exist",
    ("table", "solve", "no_such_table"): "choose one of",
    ("table", "show", "absent.toml"): "absent.toml does not exist",
    ("table", "check", "FILE.toml"): "FILE.toml does not exist",
    ("figure", "timeline", "--run", "absent"): "is not a folder",
    ("figure", "trade-off", "--study", "absent"): "holds no complete study",
    ("export", "FILE"): "holds no run",
    ("replay", "FILE"): "is not a folder",
    ("replay", "STRANGE"): "unknown key 'colour'",
    ("report", "STRANGE"): "unknown key 'colour'",
    ("export", "STRANGE", "--format", "csv"): "trajectories.parquet is broken",
    ("export", "STRANGE", "--format", "fcd"): "unknown key 'colour'",
    ("figure", "timeline", "--run", "STRANGE"): "unknown key 'colour'",
    ("report", "STUDY"): "table.csv has no column scenario",
    ("figure", "trade-off", "--study", "STUDY"): "table.csv has no column planner",
    ("figure", "density-sweep", "--study", "STUDY"): "table.csv has no column scenario",
    ("figure", "sweep", "--study", "STUDY"): "table.csv has no column planner",
    ("figure", "attack", "--study", "BEGUN"): "not finished, table.csv is missing; hj-cosim study --resume --out BEGUN",
    ("figure", "schematic", "--out", "BEGUN/differences.csv"): "belongs to the study in",
    ("figure", "schematic", "--out", "BEGUN/differences"): "belongs to the study in",
    ("table", "show", "highway", "--out", "BEGUN/table.csv"): "belongs to the study in",
    ("export", "STRANGE", "--out", "BEGUN/table.csv"): "belongs to the study in",
    ("report", "STRANGE", "--out", "FILE"): "FILE: a report ends in .html or .htm",
    ("figure", "schematic", "--width", "90"): "85 or 178 mm wide, one column or two; 90 is neither",
}


@pytest.fixture
def refused(capsys, monkeypatch, tmp_path):
    """Return a function that runs the command line, checks that it refuses, and returns the sentence."""
    folder = tmp_path / "here"
    (folder / "EMPTY").mkdir(parents=True)
    (folder / "FULL").mkdir()
    (folder / "FULL" / "notes.txt").write_text("mine")
    (folder / "FILE").write_text("mine")
    (folder / "STRANGE").mkdir()
    (folder / "STRANGE" / "config.toml").write_text("colour = 'red'\n[scenario]\nname = 'x'\n")
    for name in ("trajectories.parquet", "robot.parquet", "summary.json"):
        (folder / "STRANGE" / name).write_text("mine")
    (folder / "STUDY").mkdir()
    (folder / "STUDY" / "table.csv").write_text("a,b\n1,2\n")
    (folder / "STUDY" / "windows.parquet").write_text("mine")
    (folder / "BEGUN").mkdir()
    (folder / "BEGUN" / "study.toml").write_text(A_STUDY + "program = {}")
    monkeypatch.chdir(folder)

    def listing():
        return {path.relative_to(folder): path.stat().st_mtime_ns for path in folder.rglob("*")}

    def run_command(*arguments):
        monkeypatch.setattr(sys, "argv", ["hj-cosim", *arguments])
        before = listing()
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        assert stopped.value.code == 2
        assert "Traceback" not in said.err
        assert said.out == ""
        assert listing() == before
        sentence = " ".join(said.err.split())
        assert sentence.startswith("error: ")
        assert len(sentence) < 600
        return sentence

    return run_command


@pytest.mark.parametrize("assignment", ASSIGNMENTS)
def test_wrong_knob(refused, assignment):
    sentence = refused("run", "--set", assignment)
    assert ASSIGNMENTS[assignment] in sentence
    assert assignment.partition("=")[0].rpartition(".")[2] in sentence


@pytest.mark.parametrize("content", SCENARIOS)
def test_wrong_scenario(refused, tmp_path, small_specification, content):
    mine = tmp_path / "mine.toml"
    mine.write_text(content)
    sentence = refused("run", str(mine), "--table", str(small_specification))
    assert SCENARIOS[content] in sentence


@pytest.mark.parametrize("change", SPECIFICATIONS)
def test_wrong_specification(refused, tmp_path, change):
    original = (specifications_folder() / "highway.toml").read_text()
    changed = original.replace(*change)
    assert changed != original
    mine = tmp_path / "mine.toml"
    mine.write_text(changed)
    sentence = refused("table", "solve", str(mine))
    assert SPECIFICATIONS[change] in sentence
    assert "mine.toml" in sentence


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_wrong_command(refused, arguments):
    assert COMMANDS[arguments] in refused(*arguments)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is not"),
        ("<net", "is not"),
        ("<net/>", "edge"),
        ('<!DOCTYPE net [<!ENTITY a "aaaa">]><net>&a;</net>', "DOCTYPE"),
        ('<!DOCTYPE net SYSTEM "/etc/passwd"><net/>', "DOCTYPE"),
        ('<net version="1.20"><include href="/etc/passwd"/></net>', "includes another file"),
        ("<net>" + "<edge>" * 100, "elements within each other"),
        ("\x1f\x8b", "is not"),
    ],
)
def test_wrong_network(refused, tmp_path, small_specification, content, said):
    (tmp_path / "mine.net.xml").write_text(content)
    (tmp_path / "mine.toml").write_text('[network]\nfile = "mine.net.xml"\n')
    sentence = refused("run", str(tmp_path / "mine.toml"), "--table", str(small_specification))
    assert said in sentence
    assert "mine.net.xml" in sentence


def test_a_network_of_more_than_100_mb(refused, tmp_path, small_specification):
    with (tmp_path / "mine.net.xml").open("wb") as file:
        file.writelines([b'<net version="1.20">', *[b"<!-- -->" * 125_000] * 100])
    (tmp_path / "mine.toml").write_text('[network]\nfile = "mine.net.xml"\n')
    sentence = refused("run", str(tmp_path / "mine.toml"), "--table", str(small_specification))
    assert "mine.net.xml is too large; 100 MB of network is the most" in sentence


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "study.toml: scenarios: field required"),
        ('scenarios = "paper"', "scenarios = 'paper'"),
        (A_STUDY + "program = 3", "program = 3"),
        (A_STUDY + "program = {}\nepisods = 3", "unknown key 'episods'"),
        (A_STUDY.replace("40", "0") + "program = {}", "episodes = 0"),
        (A_STUDY.replace("hjop-spc-mi", "mpc-spc-mi") + "program = {}", "no stack is called 'mpc-spc-mi'"),
        ("= 3", "is not TOML"),
        ("x = " + "[" * 4000, "within each other"),
    ],
)
def test_wrong_study_to_resume(refused, tmp_path, content, said):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.toml").write_text(content)
    sentence = refused("study", "--resume", "--out", str(tmp_path / "study"))
    assert said in sentence
    assert "study.toml" in sentence
    assert (tmp_path / "study" / "study.toml").read_text() == content


@pytest.mark.parametrize("damage", ["empty", "truncated", "altered", "pickle"])
def test_broken_table(refused, tmp_path, small_specification, small_table, damage):
    mine = tmp_path / "mine.toml"
    shutil.copy(small_specification, mine)
    table = mine.with_suffix(".npz")
    save_table(small_table, table)
    content = bytearray(table.read_bytes())
    if damage == "truncated":
        content = content[: len(content) // 2]
    elif damage == "altered":
        content[len(content) // 2] ^= 0xFF
    elif damage == "empty":
        content = bytearray()
    elif damage == "pickle":
        content = bytearray(b"\x80\x04cos\nsystem\n")
    table.write_bytes(content)
    sentence = refused("run", "--table", str(mine))
    assert "mine.npz" in sentence
    assert "solve it again" in sentence
