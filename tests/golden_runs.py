"""Three short runs whose numbers are kept in fixtures/golden.json, so that none changes in silence.

`make golden` renews them. For that, CHANGELOG.md must have a line which begins with "Numbers change:" and says why, one
that has not explained an earlier renewal; fixtures/golden.json names all lines that have.
"""

import json
import re
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hj_cosim.cosim.episode import Episode
from hj_cosim.errors import ConfigurationError
from hj_cosim.run import run_episode

HERE = Path(__file__).resolve().parent
GOLDEN = HERE / "fixtures" / "golden.json"
CHANGELOG = HERE.parent / "CHANGELOG.md"
MARK = "Numbers change:"

RUNS: Mapping[str, Mapping[str, Any]] = {
    "paper, HJOP + SPC + MI": {"scenario": "paper", "planner": "hjop", "filter": "spc", "scheme": "mi", "seed": 1},
    "dense, OP + RSS + SW": {"scenario": "dense", "planner": "op", "filter": "rss", "scheme": "sw", "seed": 2},
    "light, HJOP + None": {"scenario": "light", "planner": "hjop", "filter": "none", "seed": 3},
}
DURATION = 4.0  # s
# An older daqp fails now and then where a newer one does not; the next backend gives the same control.
MACHINE_DEPENDENT = ("solver_failures",)


def numbers_of(name: str, specification: Path) -> dict[str, Any]:
    """Return what is kept of a run: its summary, and where everybody is at its end."""
    episode = run_episode(**RUNS[name], duration=DURATION, table=str(specification))
    summary = {key: value for key, value in episode.summary.items() if key not in MACHINE_DEPENDENT}
    return {**summary, **_at_the_end(episode)}


def _at_the_end(episode: Episode) -> dict[str, float]:
    robot, traffic = episode.record.robot, episode.record.traffic
    here = traffic.present[-1]
    own = {f"robot_{name}": float(getattr(robot, name)[-1]) for name in ("x", "y", "heading", "speed")}
    others = {f"mean_{name}_of_cars": float(getattr(traffic, name)[-1, here].mean()) for name in ("x", "y", "speed")}
    return own | others


def changelog_lines(text: str) -> list[str]:
    """Return the entries of a changelog that say that numbers change, each in one line."""
    entries = re.findall(r"^- (.*(?:\n  .*)*)", text, flags=re.MULTILINE)
    lines = [" ".join(entry.split()) for entry in entries]
    return [line for line in lines if line.startswith(MARK)]


def renewed(kept: Mapping[str, Any], runs: Mapping[str, Any], changelog: str) -> dict[str, Any]:
    """Return the content of golden.json with the numbers of `runs`.

    Args:
        kept: its content up to now.
        runs: the numbers of each run.
        changelog: CHANGELOG.md's text.

    Raises:
        ConfigurationError: if no new line of the changelog explains that the numbers change.
    """
    explained: Sequence[str] = kept["explained_by"]
    if runs == kept["runs"]:
        return dict(kept)
    new = [line for line in changelog_lines(changelog) if line not in explained]
    if not new:
        raise ConfigurationError(
            f"{CHANGELOG.name} has no new entry '- {MARK} ...'; write one that says why, then renew"
        )
    return {"explained_by": [*explained, *new], "runs": dict(runs)}


def main() -> None:
    """Renew golden.json."""
    with tempfile.TemporaryDirectory() as folder:
        specification = Path(shutil.copy(HERE / "fixtures" / "highway_small.toml", folder))
        runs = {name: numbers_of(name, specification) for name in RUNS}
    kept = json.loads(GOLDEN.read_text())
    try:
        content = renewed(kept, runs, CHANGELOG.read_text(encoding="utf-8"))
    except ConfigurationError as error:
        sys.exit(f"error: {error}")
    GOLDEN.write_text(json.dumps(content, indent=2) + "\n")
    print("nothing has changed" if content == kept else f"renewed {GOLDEN}: {content['explained_by'][-1]}")


if __name__ == "__main__":
    main()
