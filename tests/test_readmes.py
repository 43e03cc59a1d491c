"""What the READMEs say is so: files, links, commands, columns, and the examples as they are printed."""

import re
import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import typer

from hj_cosim import load_scenario, load_table
from hj_cosim.cli.commands import app
from hj_cosim.recording import run_folder
from hj_cosim.recording.record import RobotTrack, ThreatTrack
from hj_cosim.recording.study_files import STUDY, TABLE
from hj_cosim.settings import Scenario
from hj_cosim.vehicles.idm import PARAMETER_NAMES

HOUSE = Path(__file__).resolve().parents[1]
READMES = [HOUSE / folder / "README.md" for folder in ("", "hj_cosim", "sumo_net", "value_tables", "runs", "tests")]


def readme(folder: str = "") -> str:
    return (HOUSE / folder / "README.md").read_text(encoding="utf-8")


def blocks(text: str) -> dict[str, str]:
    """Return the code blocks that name a file in their first line, by that name."""
    found = re.findall(r"```\w+\n(# (\w+\.\w+).*?)```", text, flags=re.DOTALL)
    return {name: block for block, name in found}


def test_the_readme_is_read_in_one_go():
    assert len(readme().splitlines()) < 150


@pytest.mark.parametrize("path", READMES, ids=lambda path: path.parent.name)
def test_links_and_pictures_lead_somewhere(path):
    links = re.findall(r"\]\(([^)#:]+)\)", path.read_text(encoding="utf-8"))
    assert [link for link in links if not (path.parent / link).exists()] == []


def test_the_map_names_what_there_is():
    text = readme("hj_cosim")
    named = set(re.findall(r"`((?:\w+/)*\w+(?:\.py|/))`", text))
    bare = {name for name in named if "/" not in name}  # said beside another file of their folder
    missing = {name for name in named - bare if not any((HOUSE / top / name).exists() for top in ("", "hj_cosim"))}
    assert missing == {name for name in missing if list((HOUSE / "hj_cosim").rglob(name.rstrip("/")))}
    assert all(list((HOUSE / "hj_cosim").rglob(name)) for name in bare)
    rooms = {path.parent.name for path in (HOUSE / "hj_cosim").glob("*/__init__.py")}
    assert {f"{room}/" for room in rooms} <= named


@pytest.mark.parametrize("path", READMES, ids=lambda path: path.parent.name)
def test_commands_and_their_options_exist(path):
    group = typer.main.get_command(app)
    for line in re.findall(r"`hj-cosim ([^`]+)`", path.read_text(encoding="utf-8")):
        words = line.split()
        command = group.commands[words[0]]
        if hasattr(command, "commands"):
            command = command.commands[words[1]]
        options = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
        asked = {word for word in words if word.startswith("--")}
        assert asked <= options | {"--help"}, line


def test_every_file_and_column_of_a_run_is_explained():
    text = readme("runs")
    for name in (*run_folder.OWN_FILES, STUDY, TABLE):
        assert re.search(rf"^\| `{name}/?` \|", text, flags=re.MULTILINE), name
    first_cells = re.findall(r"^\| ([a-z_0-9, ]+) \|", text, flags=re.MULTILINE)
    explained = {word for cell in first_cells for word in cell.split(", ")}
    columns = {"time"} | {field.name for track in (RobotTrack, ThreatTrack) for field in fields(track)}
    assert columns <= explained
    drivers = next(line for line in text.splitlines() if line.startswith("| `drivers.parquet`"))
    assert all(name in drivers for name in PARAMETER_NAMES)
    trajectories = next(line for line in text.splitlines() if line.startswith("`trajectories.parquet`: "))
    for name in ("time", "vehicle", "x", "y", "heading", "speed", "acceleration", "lane", "length", "width"):
        assert re.search(rf"\b{name}\b", trajectories)


def test_the_game_of_ones_own_is_solved_as_printed(tmp_path):
    printed = blocks(readme("value_tables"))
    for name in ("walker.py", "my_spec.toml"):
        (tmp_path / name).write_text(printed[name])
    table = load_table(str(tmp_path / "my_spec.toml"))
    x = np.linspace(-1.9, 1.9, 20)
    value = table.value(np.column_stack([x, np.zeros(20)]))
    assert value == pytest.approx(np.abs(x) - 0.5, abs=0.03)  # who may walk away loses nothing


def test_the_scenario_of_ones_own_is_read_as_printed(tmp_path):
    text = blocks(readme("sumo_net"))["mine.toml"]
    (tmp_path / "mine.toml").write_text(text)
    scenario = load_scenario(str(tmp_path / "mine.toml"))
    assert isinstance(scenario, Scenario)
    assert len(scenario.cars) == len(tomllib.loads(text)["cars"]) == 1
    assert scenario.traffic.count == 20


def test_every_scenario_and_specification_is_in_its_folders_readme():
    for folder in ("sumo_net", "value_tables"):
        for path in (HOUSE / folder).glob("*.toml"):
            assert f"`{path.stem}`" in readme(folder), path.name


def test_the_citation_is_of_the_paper_and_the_licence_ours():
    text = (HOUSE / "CITATION.cff").read_text(encoding="utf-8")
    project = tomllib.loads((HOUSE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"license: {project['license']}\n" in text
    assert f"version: {project['version']}\n" in text
    paper = "Infusing Reachability-Based Safety into Planning and Control for Multi-agent Interactions"
    assert paper in " ".join(text.split())
    assert all(f"family-names: {name}\n" in text for name in ("Wang", "Leung", "Pavone"))
