"""Files appear whole or not at all."""

import stat

import pytest

from hj_cosim.errors import HjCosimError
from hj_cosim.files import UNFINISHED, require_writable, temporary_folder, whole_file


def test_file_appears_when_the_block_ends(tmp_path):
    path = tmp_path / "new" / "numbers.txt"
    with whole_file(path) as temporary:
        temporary.write_text("1 2 3")
        assert not path.exists()
    assert path.read_text() == "1 2 3"
    assert [entry.name for entry in path.parent.iterdir()] == ["numbers.txt"]


def test_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "numbers.txt"
    path.write_text("old")

    def fail_half_way():
        with whole_file(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail_half_way()
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["numbers.txt"]


def test_file_is_as_readable_as_any_other(tmp_path):
    plain, whole = tmp_path / "plain.txt", tmp_path / "whole.txt"
    plain.write_text("")
    with whole_file(whole) as temporary:
        temporary.write_text("")
    assert stat.S_IMODE(whole.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(HjCosimError, match=r"cannot write .*numbers\.txt: .*; choose another place"),
        whole_file(tmp_path / "file" / "numbers.txt"),
    ):
        pass


def test_what_is_unfinished_goes_with_the_next_file_unless_its_process_lives(tmp_path):
    """The lock tells: this process holds the one that it is writing, and nobody the others."""
    abandoned = [tmp_path / f".numbers{UNFINISHED}killed.txt", tmp_path / f".run{UNFINISHED}killed"]
    abandoned[0].write_text("1 2")
    (abandoned[1] / "figures").mkdir(parents=True)
    mine = tmp_path / ".numbers.txt"
    mine.write_text("mine")
    with whole_file(tmp_path / "slow.txt") as slow, temporary_folder(tmp_path) as folder:
        slow.write_text("slow")
        assert not any(path.exists() for path in abandoned)
        with whole_file(tmp_path / "numbers.txt") as temporary:
            temporary.write_text("1 2 3")
        require_writable(tmp_path / "run")
        assert slow.exists()
        assert folder.is_dir()
    assert sorted(path.name for path in tmp_path.iterdir()) == [".numbers.txt", "numbers.txt", "slow.txt"]


def test_folder_that_was_moved_stays(tmp_path):
    with temporary_folder(tmp_path, "run") as folder:
        (folder / "numbers.txt").write_text("1 2 3")
        folder.replace(tmp_path / "run")
    assert [path.name for path in tmp_path.rglob("*")] == ["run", "numbers.txt"]


def test_check_before_the_work_names_the_place_and_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HjCosimError, match=r"cannot write .*file/run: Not a directory; choose another place"):
        require_writable(tmp_path / "file" / "run")
    require_writable(tmp_path / "new" / "run")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
