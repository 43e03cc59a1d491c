"""Files appear whole or not at all."""

import stat

import pytest

from hj_cosim.errors import HjCosimError
from hj_cosim.files import whole_file


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
