"""Runs and studies side by side: what belongs together, on which seeds, and by how much it differs."""

import numpy as np
import pandas as pd
import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.study.comparison import differing_settings, groups_of, shown_runs
from hj_cosim.study.comparison_folder import compare
from hj_cosim.study.jobs import EpisodeJob
from hj_cosim.study.stacks import parse_stack


@pytest.fixture
def study(synthetic, tmp_path):
    """Return a function that writes the episodes of a study, in the paper's traffic, and returns its folder."""

    def write(name, seeds=range(4), stacks=("hjop-spc-mi", "op-none"), settings=(), keep="all"):
        for stack in map(parse_stack, stacks):
            config = resolve_config("paper", flags=stack.flags, assignments=settings)
            for seed in seeds:
                folder = tmp_path / name / "episodes" / stack.name / str(seed)
                own = config.model_copy(update={"seed": seed})
                synthetic.drive(EpisodeJob(own, tmp_path / "table.npz", folder, keep))
        return tmp_path / name

    return write


def row(table, metric, side):
    (found,) = table[(table["metric"] == metric) & (table["side"] == side)].to_dict("records")
    return found


def test_two_runs_differ_by_their_summaries_without_an_interval(study, tmp_path):
    folder = study("study", range(1))
    runs = [folder / "episodes" / stack / "0" for stack in ("hjop-spc-mi", "op-none")]
    places = [tmp_path / name for name in ("mine", "other")]
    for run, place in zip(runs, places, strict=True):
        run.rename(place)
    (group,) = groups_of(places)
    table = group.table()
    mine, other = (row(table, "mean_speed", side) for side in ("mine", "other"))
    assert other["difference"] == pytest.approx(other["value"] - mine["value"])
    assert other["difference"] == pytest.approx(3.0, abs=0.05)
    assert np.isnan(mine["difference"])
    assert "difference_lo" not in table
    assert group.title == ""
    assert dict(differing_settings(group))["planner.kind"] == ["hjop", "op"]
    assert "seed" not in dict(differing_settings(group))


def test_rows_of_two_studies_are_paired_on_the_seeds_that_both_have(study):
    first = study("first")
    second = study("second", range(2, 6), settings=["planner.gamma_r=0.8", "scenario.description=other words"])
    groups = groups_of([first, second])
    assert [group.title for group in groups] == ["paper, hjop-spc-mi", "paper, op-none"]
    table = groups[1].table()
    same = row(table, "ttc_ge_3", "second")
    assert same["pairs"] == 2
    # Seeds 2 and 3 give the same synthetic drives in both: paired, nothing is left; unpaired, much would be.
    assert same["difference"] == same["difference_lo"] == same["difference_hi"] == 0.0
    assert same["value_lo"] < same["value_hi"]
    assert dict(differing_settings(groups[0])) == {"planner.gamma_r": ["0.9", "0.8"]}


def test_without_a_common_seed_the_interval_is_that_of_independent_rows(study):
    first = study("first", range(4), ["op-none"])
    second = study("second", range(10, 14), ["op-none"])
    (group,) = groups_of([first, second])
    told = row(group.table(), "ttc_p1", "second")
    assert told["pairs"] == 0
    samples = []
    draw = np.random.default_rng(0)
    ours, theirs = ([side.statistics.summary(seed)["mean_speed"] for seed in side.runs] for side in group.sides[::-1])
    for _ in range(4000):
        samples.append(np.mean(draw.choice(ours, 4)) - np.mean(draw.choice(theirs, 4)))
    speed = row(group.table(), "mean_speed", "second")
    assert speed["difference"] == pytest.approx(np.mean(ours) - np.mean(theirs))
    assert [speed["difference_lo"], speed["difference_hi"]] == pytest.approx(
        np.percentile(samples, [2.5, 97.5]), abs=2e-3
    )


def test_sums_over_unequally_many_episodes_are_not_compared(study):
    first = study("first", range(2), ["op-none"])
    second = study("second", range(10, 13), ["op-none"])
    (group,) = groups_of([first, second])
    table = group.table()
    assert row(table, "collision_episodes", "second")["episodes"] == 3
    assert np.isnan(row(table, "collision_episodes", "second")["difference"])
    assert np.isfinite(row(table, "mean_speed", "second")["difference"])


def test_a_run_is_laid_beside_the_row_of_a_study_that_it_belongs_to(study, tmp_path):
    alone = study("alone", [2], ["op-none"]) / "episodes/op-none/2"
    (group,) = groups_of([study("study"), alone])
    assert group.title == "paper, op-none"
    assert row(group.table(), "mean_speed", "2")["pairs"] == 1
    assert row(group.table(), "mean_speed", "2")["difference"] == 0.0


def test_shown_is_a_seed_at_which_one_crashed_and_the_other_did_not(study, tmp_path):
    folder = study("study")
    runs = [folder / "episodes" / stack for stack in ("hjop-spc-mi", "op-none")]
    for name, run in zip(("one", "two"), runs, strict=True):
        (tmp_path / name / "episodes").mkdir(parents=True)
        run.rename(tmp_path / name / "episodes" / "stack")
    (group,) = groups_of([tmp_path / "one", tmp_path / "two"])
    hits = [{seed: side.statistics.summary(seed)["collisions"] for seed in side.runs} for side in group.sides]
    apart = [seed for seed in hits[0] if (hits[0][seed] > 0) != (hits[1][seed] > 0)]
    chosen = shown_runs([group])
    assert apart
    assert int(chosen["one"].name) in apart
    assert chosen["one"].name == chosen["two"].name


def test_what_cannot_be_compared_is_refused(study, tmp_path):
    folder, other = study("study", [0]), study("other", [0], ["op-spc-sw", "op-rss-sw"])
    with pytest.raises(ConfigurationError, match="1 folders are given; 2 to 6 can be compared"):
        groups_of([folder])
    with pytest.raises(ConfigurationError, match="a folder is given twice"):
        groups_of([folder, folder / "../study"])
    with pytest.raises(ConfigurationError, match=r"no row is in two of them: .*study has paper, hjop-spc-mi"):
        groups_of([folder, other])
    with pytest.raises(RunFolderError, match="neither a run nor a study"):
        groups_of([folder, tmp_path])


def test_a_comparison_of_studies_without_cars_has_its_table_and_page(call, study, tmp_path):
    folders = [study(name, keep="robot") for name in ("first", "second")]
    out = tmp_path / "compared"
    done = compare(folders, out)
    assert done.shown == ()
    assert {path.name for path in out.iterdir()} == {"comparison.csv", "comparison.html"}
    assert len(pd.read_csv(out / "comparison.csv")) == len(done.table)
    page = (out / "comparison.html").read_text()
    assert "paper, hjop-spc-mi" in page
    assert "<iframe" not in page
    status, printed, _ = call("compare", *folders, "--out", tmp_path / "again")
    assert (status, "4 episodes" in printed) == (0, True)
    assert call("compare", folders[0], "--out", tmp_path / "alone")[0] == 2
    assert not (tmp_path / "alone").exists()
