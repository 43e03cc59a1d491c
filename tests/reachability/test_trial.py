"""Games of one's own that are wrong end in a sentence before the solver's compiled loops run them."""

from pathlib import Path

import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.examples import own_game
from hj_cosim.reachability.table.store import solve_table

TABLE = """
dynamics = "boat.py"
horizon = 0.2
[grid]
lower = [-2.0, -2.0]
upper = [2.0, 2.0]
shape = [21, 21]
"""
BOAT = Path(own_game.__file__).read_text(encoding="utf-8").partition("\nSPECIFICATION")[0]
WRONG = {
    "- c[HALF_WIDTH]": ("- c[57]", r"boat\.py:14: target reaches beyond an array: index 57 .* and 3 parameters"),
    "        out[i] = max(": ("        other = max(", r"boat\.py:14: target does not write all of its output"),
    "    for i in range(out.shape[0]):\n        out[i] = (c": (
        "    for i in range(out.shape[0] - 1):\n        out[i] = (c",
        "hamiltonian does not write all",
    ),
    "            d[axis, i] = -sign": ("            v = -sign", "optimal_inputs does not write all"),
    "        out[1, i] = u[1, i] + d[1, i]": ("        out[2, i] = u[1, i] + d[1, i]", "flow reaches beyond an array"),
    '(x, c, out):\n    """V(0': (
        '(x, out):\n    """V(0',
        "target raised TypeError: .*takes 2 positional",
    ),
    'boundary=("linear"': ('boundary=("liner"', "boundary has the entry 'liner'; choose 'linear' or 'away_from_zero'"),
    'outside=("safe"': ('outside=("saef"', "outside has the entry 'saef'; choose 'safe' or 'clamp'"),
    "    target=target,": ("    target=3,", "game boat: target is no function, but 3"),
    "from pathlib import Path": ("import fractions\nfractions.Fraction(1, 0)", "fails on import: ZeroDivisionError"),
    "SPEED, CURRENT, HALF_WIDTH = 0, 1, 2": ("raise SystemExit(3)", "fails on import: SystemExit: 3"),
}


def solved(folder: Path, text: str) -> None:
    (folder / "boat.py").write_text(text)
    (folder / "boat.toml").write_text(TABLE)
    solve_table(str(folder / "boat.toml"))


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_with_a_game_is_said_and_where(tmp_path, right):
    wrong, sentence = WRONG[right]
    assert right in BOAT
    with pytest.raises(ConfigurationError, match=sentence):
        solved(tmp_path, BOAT.replace(right, wrong, 1))


def test_a_dissipation_of_nothing_is_refused_for_nothing_would_move(tmp_path):
    text = BOAT.replace("out[0, i] = abs(c[SPEED] - c[CURRENT])", "out[0, i] = 0.0")
    with pytest.raises(ConfigurationError, match=r"boat\.toml: the game's dissipation comes to 0 on this grid"):
        solved(tmp_path, text.replace("out[1, i] = abs(c[SPEED] - c[CURRENT])", "out[1, i] = 0.0"))


def test_a_game_that_divides_by_zero_somewhere_is_judged_by_what_it_answers_compiled(tmp_path):
    solved(
        tmp_path, BOAT.replace("- c[HALF_WIDTH]", "- c[HALF_WIDTH] + 0.0 * min(1.0 / float(abs(x[0, i] - 2.0)), 1.0)")
    )
