"""A planner of one's own: pass on the left, else keep right; tried, then driven beside ours under the same filter."""

from hj_cosim import run_episode
from hj_cosim.planning.contract import IDLE, LEFT, RIGHT, Plan
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import Settings
from hj_cosim.testing import check_planner


class KeepRight:
    """Asks for the lane to the left where the next car is near and slower, and for the right one where it is free."""

    class Options(Settings):
        """What `--set planner.options.KEY=VALUE` sets."""

        near: float = 40.0  # m
        speed: float = 26.0  # m/s

    def __init__(self, options: "KeepRight.Options", road: Road) -> None:
        """Take what is asked for by name; planning/contract.py lists what there is."""
        self.options, self.road = options, road

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the lane and the speed to be reached, once a second."""
        lane = previous.lane
        if self._is_taken(observation, lane) and lane + 1 < self.road.lane_count:
            return Plan(LEFT, Target(lane + 1, self.options.speed))
        if lane > 0 and not self._is_taken(observation, lane - 1):
            return Plan(RIGHT, Target(lane - 1, self.options.speed))
        return Plan(IDLE, Target(lane, self.options.speed))

    def _is_taken(self, observation: Observation, lane: int) -> bool:
        ahead = observation.x - observation.robot[0]
        near = (observation.lane == lane) & (ahead > -10.0) & (ahead < self.options.near)
        return bool((near & (observation.speed < self.options.speed)).any())


def main(duration: float = 30.0, table: str = "highway", seeds: range = range(3)) -> None:
    """Check the planner against what a planner must do, then drive it beside HJOP on the same seeds."""
    check_planner(KeepRight)
    for seed in seeds:
        for planner in (KeepRight, "hjop"):
            print(run_episode("paper", planner=planner, seed=seed, duration=duration, table=table))


if __name__ == "__main__":
    main()
