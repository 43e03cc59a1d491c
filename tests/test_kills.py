"""kill -9 leaves whole files or none, and the next call works; tests/benchmarks/test_kills.py does it 100 times."""

import random

import kills
import pytest

from hj_cosim.reachability.table.store import read_table


@pytest.mark.parametrize(("make", "seed"), [(kills.a_run, 1), (kills.a_solve, 2)])
def test_killed_call_leaves_whole_files_or_none_and_the_next_one_works(make, seed, small_specification, small_table,
                                                                       tmp_path):  # fmt: skip
    victim = make(tmp_path / "victim", small_specification)
    moments = random.Random(seed)
    for while_writing in (False, True):
        kills.kill(victim, moments.uniform(0.0, 0.02 if while_writing else 0.3), while_writing=while_writing)
        kills.read_all(victim)
    kills.next_call(victim)
    assert kills.read_all(victim)["run/config.toml"] if make is kills.a_run else victim.place.is_file()
    kills.clear(victim)
    assert kills.next_call(victim) == "done anew"
    assert kills.left_behind(victim) == []


def test_two_solves_of_one_table_at_once_end_in_one_good_table(small_specification, small_table, tmp_path):
    victim = kills.a_solve(tmp_path / "folder", small_specification)
    both = [kills.start(victim), kills.start(victim)]
    for process in both:
        process.join()
        assert process.exitcode == 0
    assert (read_table(victim.place).values == small_table.values).all()
    assert list(victim.folder.iterdir()) == [victim.place]
