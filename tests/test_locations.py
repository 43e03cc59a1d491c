"""Names and paths: what a user calls a thing, and where it lies."""

import os

import pytest

from hj_cosim import locations
from hj_cosim.errors import ConfigurationError


def test_name_and_path_mean_the_same_file():
    path = locations.scenarios_folder() / "paper.toml"
    assert locations.find_toml("paper", locations.scenarios_folder(), "scenario") == path
    assert locations.find_toml(str(path), locations.scenarios_folder(), "scenario") == path


def test_unknown_name_is_answered_with_the_names_that_exist():
    with pytest.raises(ConfigurationError, match=r"no scenario is called 'papr'; choose one of .*paper.*\.toml"):
        locations.find_toml("papr", locations.scenarios_folder(), "scenario")


def test_path_to_nowhere_is_named():
    with pytest.raises(ConfigurationError, match=r"scenario file nowhere/x\.toml does not exist"):
        locations.find_toml("nowhere/x.toml", locations.scenarios_folder(), "scenario")


def test_a_path_is_whole_and_a_name_stays_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to(tmp_path)
    for given in ("mine.toml", "./mine.toml", "link/mine.toml", f"../{tmp_path.name}/mine.toml"):
        assert locations.whole_name(given, "table =") == str(tmp_path / "mine.toml")
    assert locations.whole_name("mine.npz", "table =") == str(tmp_path / "mine.npz")
    assert locations.whole_name("highway", "table =") == "highway"
    with pytest.raises(ConfigurationError, match=r"table = '~unheard-of/x\.toml': no file has such a path"):
        locations.whole_name("~unheard-of/x.toml", "table =")


def test_outside_a_clone_runs_go_to_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert locations.runs_folder() == tmp_path / "runs"


def test_a_folder_that_has_been_removed_and_a_name_that_no_text_file_holds_are_said(tmp_path, monkeypatch):
    odd = tmp_path / os.fsdecode(b"ab\xff")
    odd.mkdir()
    sentence = r"ab\\udcff.* is not UTF-8, so that no text file can hold it; rename it"
    for asked in (lambda: locations.given_path(odd, "out"), lambda: locations.whole_path(str(odd), "the file")):
        with pytest.raises(ConfigurationError, match=sentence):
            asked()
    monkeypatch.chdir(odd)
    with pytest.raises(ConfigurationError, match=sentence):
        locations.runs_folder()
    odd.rmdir()
    with pytest.raises(ConfigurationError, match="the current folder has been removed; change to one that is there"):
        locations.runs_folder()
