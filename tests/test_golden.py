"""Nothing changes the numbers in silence: three short runs give what fixtures/golden.json holds."""

import json

import golden_runs
import pytest

from hj_cosim.errors import ConfigurationError

# Whole numbers and texts are compared exactly, floating point to this share of itself. Compilers of other processors
# round elsewhere in a sum or a product, from the table's float32 on: with kernels for a processor without fused
# multiply-add (NUMBA_CPU_NAME=generic), the numbers differed by 1.8e-6 at most, in the largest jerk.
TOLERANCE = 1e-5


@pytest.fixture(scope="module")
def golden():
    return json.loads(golden_runs.GOLDEN.read_text())


@pytest.mark.parametrize("name", golden_runs.RUNS)
def test_run_gives_the_numbers_that_are_kept(golden, small_specification, small_table, name):
    numbers, kept = golden_runs.numbers_of(name, small_specification), golden["runs"][name]
    assert numbers.keys() == kept.keys()
    changed = {key: (kept[key], numbers[key]) for key in kept if not _agree(kept[key], numbers[key])}
    assert not changed, "if this is meant, say why in CHANGELOG.md ('- Numbers change: ...') and `make golden`"


def _agree(kept, now):
    if isinstance(kept, float):
        return now == pytest.approx(kept, rel=TOLERANCE, abs=1e-9)
    return now == kept and type(now) is type(kept)


def test_every_renewal_is_explained_in_the_changelog(golden):
    lines = golden_runs.changelog_lines(golden_runs.CHANGELOG.read_text(encoding="utf-8"))
    missing = [line for line in golden["explained_by"] if line not in lines]
    assert not missing, "fixtures/golden.json was renewed with these lines, which CHANGELOG.md no longer has"


def test_renewal_needs_a_line_that_explained_none_before():
    kept = {"explained_by": [], "runs": {"a": 1.0}}
    text = "# Changelog\n\n- Some feature.\n- Numbers change: the drivers\n  look further ahead.\n"
    assert golden_runs.renewed(kept, {"a": 1.0}, "# Changelog\n") == kept
    with pytest.raises(ConfigurationError, match="has no new entry '- Numbers change"):
        golden_runs.renewed(kept, {"a": 2.0}, "# Changelog\n\n- Some feature.\n")
    once = golden_runs.renewed(kept, {"a": 2.0}, text)
    assert once == {"explained_by": ["Numbers change: the drivers look further ahead."], "runs": {"a": 2.0}}
    with pytest.raises(ConfigurationError, match="has no new entry"):
        golden_runs.renewed(once, {"a": 3.0}, text)
    twice = golden_runs.renewed(once, {"a": 3.0}, f"{text}- Numbers change: and to the side.\n")
    assert twice["explained_by"] == [*once["explained_by"], "Numbers change: and to the side."]
