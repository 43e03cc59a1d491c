"""kill -9 at 100 random moments of run, solve and study: whole files or none, and the next call works.

Half of the victims are killed at a moment drawn over the whole time that they take, the others soon after something
unfinished lies in their folder. What the last one left is not cleared away before the next one starts, unless that
next call is the one that has to work: so what is left would add up, if it did.
"""

import random
import tomllib
from collections import Counter
from pathlib import Path

import kills
import pytest
import tomli_w

SOON = (
    -4.0,
    -1.3,
)  # 10 to these powers are the s after which one that has begun to write is killed:


@pytest.fixture
def large_specification(small_specification: Path, tmp_path: Path) -> Path:
    """Return a table of 26 MB, which takes long to write beside what it takes to solve."""
    path = tmp_path / "large.toml"
    large = tomllib.loads(small_specification.read_text())
    large["horizon"], large["grid"]["shape"] = 0.05, [61, 25, 17, 17, 15]
    path.write_text(tomli_w.dumps(large))
    return path


@pytest.mark.parametrize(("make", "count"), [(kills.a_run, 40), (kills.a_solve, 40), (kills.a_study, 20)])
def test_kills_leave_whole_files_or_none_and_the_next_call_works(
    make, count, small_specification, large_specification, small_table, tmp_path
):
    specification = large_specification if make is kills.a_solve else small_specification
    victim: kills.Victim = make(tmp_path / "victim", specification)
    kills.seconds_of(victim)  # loads or compiles every kernel
    seconds = kills.seconds_of(victim)
    assert kills.next_call(victim) == "done anew"
    whole = kills.read_all(victim)
    kills.clear(victim)
    moments = random.Random(count)
    outcomes: Counter[str] = Counter()
    print(f"\n{victim.name}: {seconds:.2f} s undisturbed, {count} kills")
    for number in range(count):
        while_writing = number % 2 == 1
        moment = 10.0 ** moments.uniform(*SOON) if while_writing else moments.uniform(0.0, 1.05 * seconds)
        was_at_work = kills.kill(victim, moment, while_writing=while_writing)
        unfinished, content = kills.left_behind(victim), kills.read_all(victim)
        assert all(whole[name] == content[name] for name in content if _is_final(name))
        places = [_shown(path, victim) for path in victim.folder.rglob("*") if not path.is_dir()]
        after = kills.next_call(victim)
        outcome = f"{len(unfinished)} unfinished, then {after}" if was_at_work else f"had ended, then {after}"
        outcomes[outcome] += 1
        where = "after it began to write" if while_writing else "after its start"
        print(f"  {moment:7.4f} s {where}: {len(places)} files, {outcome}")
        content = kills.read_all(victim)
        pictures = {name for name in whole if name.endswith(".png")} if after.startswith("was whole") else set()
        assert content.keys() >= whole.keys() - pictures
        assert all(content[name] == whole[name] for name in content)
        # The next call has cleared away what the killed one had left.
        assert kills.left_behind(victim) == [] or after.startswith("was whole")
        kills.clear(victim)
    for outcome, times in outcomes.most_common():
        print(f"  {times:3d} x {outcome}")


def _is_final(name: str) -> bool:
    """Whether a file, once it is there, is not written again: a study's tables are, when it is resumed."""
    return "episodes/" in name or name.startswith("run/")


def _shown(path: Path, victim: kills.Victim) -> str:
    return path.relative_to(victim.folder).as_posix()
