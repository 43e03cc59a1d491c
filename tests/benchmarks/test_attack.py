"""Under attack, over all kinds of drivers who mean harm: the table of tests/README, of a study or of a short one.

`HJ_COSIM_STUDY=DIR .venv/bin/python -m pytest tests/benchmarks/test_attack.py -s -p no:xdist` prints it of the study in
DIR, which is not changed; without one a study of SEEDS seeds is driven, some minutes.
"""

import os
from pathlib import Path

import numpy as np
import pandas as pd

from hj_cosim import read_study, run_study
from hj_cosim.study.bootstrap import draw_weights, interval
from hj_cosim.study.study import Study

SEEDS = 2
BEHAVIOUR, SHARE = "scenario.rogues.behaviour", "scenario.rogues.share"
KINDS = ("cut_in", "brake_check", "tailgate", "drift", "block", "worst")
STACKS = [f"{planner}-{filtered}" for planner in ("hjop", "op") for filtered in ("spc-mi", "rss-mi", "none")]
COUNTED = ("collisions", "collisions_responsible", "mean_speed")


def test_collisions_under_attack_by_stack(tmp_path: Path) -> None:
    drives = _study(tmp_path).episodes
    by_seed = drives.groupby(["planner", "filter", SHARE, "seed"])
    assert (by_seed[BEHAVIOUR].nunique() == drives[BEHAVIOUR].nunique()).all(), "a seed without some of the kinds"
    print(f"\n{drives.seed.nunique()} seeds, {len(drives)} drives; a drive, over all kinds, 95 % intervals over seeds")
    for (planner, filtered, share), seeds in by_seed[list(COUNTED)].mean().groupby(["planner", "filter", SHARE]):
        texts = [_with_interval(seeds[name].to_numpy()) for name in COUNTED[:2]]
        print(f"{planner:>5} {filtered:>5} at {share:4.0%}: {texts[0]} (the robot's {texts[1]})", end="")
        print(f" at {seeds.mean_speed.mean():.1f} m/s")
    for name, some in (("all", drives), ("without worst", drives[drives[BEHAVIOUR] != "worst"])):
        left = some.groupby(["planner", "filter"]).collisions.mean()
        shares = ", ".join(
            f"{planner} {filtered} {left[planner, filtered]:.3f} of {left[planner, 'none']:.3f}:"
            f" {left[planner, filtered] / left[planner, 'none']:.1%}"
            for planner, filtered in left.index
            if filtered != "none"
        )
        print(f"of no filter's collisions, {name}: {shares}")
    at_fault = drives[(drives["filter"] == "spc") & (drives.collisions_responsible > 0)]
    counted = int(at_fault.collisions_responsible.sum())
    print(f"by SPC's robot's own fault {counted} in {(drives['filter'] == 'spc').sum()} drives:")
    print(at_fault[["planner", BEHAVIOUR, SHARE, "seed"]].to_string(index=False))
    most = drives[drives[SHARE] == drives[SHARE].max()]
    print(pd.pivot_table(most, "collisions", ["planner", "filter"], BEHAVIOUR).round(3).to_string())


def _study(folder: Path) -> Study:
    if "HJ_COSIM_STUDY" in os.environ:
        return read_study(os.environ["HJ_COSIM_STUDY"])
    vary = {BEHAVIOUR: KINDS, SHARE: (0.05, 0.2)}
    driven = run_study(
        "rogues", episodes=SEEDS, seed=1000, stacks=STACKS, vary=vary, keep="robot", out=folder / "study"
    )
    assert not driven.failures
    return driven


def _with_interval(by_seed: np.ndarray) -> str:
    weights = draw_weights(len(by_seed))
    low, high = interval(weights @ by_seed / weights.sum(axis=1), len(by_seed))
    return f"{by_seed.mean():.3f} [{low:.3f}, {high:.3f}]"
