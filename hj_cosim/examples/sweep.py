"""Sweep the planner's weight γ_R over three densities, on the same seeds, and print who is faster with intervals."""

from pathlib import Path

from hj_cosim import read_study, run_study


# Five parameters that one may want to change, and none that one has to.
def main(
    out: Path = Path("sweep"),
    episodes: int = 10,
    duration: float = 30.0,
    table: str = "highway",
    scenarios: tuple[str, ...] = ("light", "paper", "dense"),
) -> None:
    """Drive `episodes` for each density and weight on two workers, and print the table and the paired differences."""
    run_study(
        scenarios,
        stacks=[{"planner": "hjop", "filter": "spc", "scheme": "mi"}],
        vary={"planner.gamma_r": [0.8, 1.0]},
        settings={"simulation.duration": duration, "table": table},
        episodes=episodes,
        workers=2,
        keep="robot",  # no trajectories of the other cars: a twentieth of the size
        out=out,
    )
    study = read_study(out)
    print(study)
    print(study.table[["scenario", "planner.gamma_r", "mean_speed", "mean_speed_lo", "mean_speed_hi"]])

    # Both weights met the same traffic, so that what is hard for both falls out of their difference.
    same_scenario = study.differences[study.differences["scenario"] == study.differences["other_scenario"]]
    print(same_scenario[["scenario", "mean_speed", "mean_speed_lo", "mean_speed_hi"]])

    crashed = study.episodes[study.episodes["collisions"] > 0]
    print(f"{len(crashed)} of {len(study.episodes)} episodes crashed")


if __name__ == "__main__":
    main()
