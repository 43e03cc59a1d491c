"""Drive ten seconds in dense traffic, look at the robot's DataFrame, and plot its speed and its value."""

from pathlib import Path

from matplotlib.figure import Figure

from hj_cosim import run_episode


def main(out: Path = Path("drive"), duration: float = 10.0, table: str = "highway") -> None:
    """Drive, print what happened, and write the run's folder and `speed-and-value.png` in it."""
    episode = run_episode("dense", seed=3, duration=duration, table=table, out=out, figures=False)
    print(episode)

    robot = episode.robot  # a row per 0.02 s, SI units: runs/README.md explains each column
    print(robot[["speed", "acceleration", "value", "ttc"]].describe())

    figure = Figure(figsize=(7, 4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(robot.time, robot.speed)
    above.plot(robot.time, robot.plan_speed, "--")
    above.set_ylabel("speed, planned (m/s)")
    below.plot(robot.time, robot.value.clip(upper=30.0))
    below.axhline(0.0, color="black")
    below.set(ylabel="least V of all cars (m)", xlabel="time (s)")
    figure.savefig(out / "speed-and-value.png")


if __name__ == "__main__":
    main()
