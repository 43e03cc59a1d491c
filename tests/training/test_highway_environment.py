"""The Gymnasium environment: Gymnasium's own checks, what is observed, the five actions, the filter around a policy."""

from functools import partial

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import hj_cosim.training  # noqa: E402, F401
from hj_cosim.errors import ConfigurationError  # noqa: E402
from hj_cosim.planning.contract import FASTER, IDLE, LEFT, RIGHT, SLOWER  # noqa: E402
from hj_cosim.training.environment import HighwayEnv  # noqa: E402
from hj_cosim.training.filtered import SafetyFilterWrapper  # noqa: E402

QUICK = {"scenario.traffic.count": 20, "simulation.settle_time": 0.2}
AHEAD = {"lane": 0, "x": 20.0, "speed": 10.0, "desired_speed": 10.0}
SCENE = {"traffic": {"count": 0}, "robot": {"lane": 0, "speed": 20.0}, "cars": [AHEAD]}
ALONE = {**SCENE, "cars": [{**AHEAD, "x": 140.0}]}


@pytest.fixture
def make():
    """Return a function that makes an environment, which is closed at the end."""
    made = []

    def make_one(scenario="dense", **options):
        if isinstance(scenario, str):
            options["settings"] = QUICK
        made.append(HighwayEnv(scenario, **{"duration": 2.0, **options}))
        return made[-1]

    yield make_one
    for env in made:
        env.close()


@pytest.mark.filterwarnings("ignore::UserWarning")  # of Gymnasium, about spaces that are not normalised
@pytest.mark.parametrize("actions", ["continuous", "planner"])
def test_gymnasium_s_own_check_is_passed(actions):
    env = gymnasium.make("hj_cosim/Highway-v0", scenario=SCENE, actions=actions)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


def test_the_same_seed_and_actions_are_the_same_episode(make):
    env, told = make(), []
    for seed in (5, 5, 6):
        first, _ = env.reset(seed=seed)
        told.append(np.array([first, *(env.step(np.array([0.1, 1.0], np.float32))[0] for _ in range(3))]))
    assert np.array_equal(told[0], told[1])
    assert not np.array_equal(told[0], told[2])


def test_the_nearest_cars_are_seen_from_the_robot(make):
    env = make(SCENE, cars=3)
    seen, _ = env.reset(seed=0)
    assert seen.shape == (4, 7)
    assert seen[0] == pytest.approx([1, 0, 0, 0, 20.0, 5.0, 2.0], abs=1e-6)
    assert seen[1] == pytest.approx([1, 20.0, 0, 0, -10.0, 5.0, 2.0], abs=0.2)
    assert not seen[2:].any()


def test_a_continuous_action_is_held_for_a_tenth_of_a_second_in_shares_of_the_limits(make):
    env = make(ALONE)
    env.reset(seed=0)
    seen, *_ = env.step(np.array([0.0, 1.0], np.float32))
    assert seen[0, 4] == pytest.approx(20.0 + 4.0 * 0.1, abs=1e-4)
    seen, *_ = env.step(np.array([0.0, -1.0], np.float32))
    assert seen[0, 4] == pytest.approx(20.4 - 6.0 * 0.1, abs=1e-4)


def test_the_five_actions_change_lane_and_speed_as_the_planner_s(make):
    env = make({**ALONE, "robot": {"lane": 1, "speed": 20.0}}, actions="planner")
    env.reset(seed=0)
    step = env.config.planner.speed_step
    wanted = {IDLE: (1, 20.0), FASTER: (1, 20.0 + step), SLOWER: (1, 20.0 - step), LEFT: (2, 20.0), RIGHT: (0, 20.0)}
    for action, (lane, speed) in wanted.items():
        target = env._next_target(action)
        assert (target.lane, target.speed) == (lane, pytest.approx(speed)), action
    before, _ = env.reset(seed=0)
    after, *_ = env.step(LEFT)
    assert after[0, 2] > before[0, 2] + 1.0


def test_a_collision_terminates_with_no_reward_and_time_truncates(make):
    env = make(SCENE)
    env.reset(seed=0)
    rewards = []
    for _ in range(40):
        _, reward, terminated, truncated, info = env.step(np.array([0.0, 1.0], np.float32))
        rewards.append(reward)
        if terminated or truncated:
            break
    assert (terminated, truncated, info["collision"], reward) == (True, False, True, 0.0)
    assert rewards[0] > 0.0
    env.close()
    env = make(ALONE, duration=0.2)
    env.reset(seed=0)
    hold = np.zeros(2, np.float32)
    assert [env.step(hold)[3] for _ in range(2)] == [False, True]


def test_several_are_driven_at_once_in_processes_of_their_own():
    options = {"scenario": ALONE, "duration": 0.3}
    make_one = partial(HighwayEnv, **options)
    envs = gymnasium.vector.AsyncVectorEnv([make_one, make_one])
    try:
        scenes, _ = envs.reset(seed=[3, 4])
        assert scenes.shape == (2, 9, 7)
        after, _, terminated, truncated, info = envs.step(np.array([[0.0, 1.0], [0.0, -1.0]], np.float32))
        assert after[0, 0, 4] > scenes[0, 0, 4] > after[1, 0, 4]  # one speeds up, the other brakes
        for _ in range(2):
            _, _, terminated, truncated, info = envs.step(np.zeros((2, 2), np.float32))
        assert truncated.all()
        assert not terminated.any()
        assert list(info["ended"]) == ["duration", "duration"]
    finally:
        envs.close()


def test_one_s_own_reward_is_handed_what_came_of_the_action(make):
    env = make(SCENE, reward=lambda now, control, collided: float(now.robot[3]) + control.acceleration)
    env.reset(seed=0)
    seen, reward, *_ = env.step(np.array([0.0, 0.5], np.float32))
    assert reward == pytest.approx(seen[0, 4] + 2.0, abs=1e-4)


def test_the_filter_keeps_a_reckless_policy_from_the_car_ahead(make, small_table):
    env = SafetyFilterWrapper(make({**SCENE, "cars": [{**AHEAD, "x": 40.0}]}), table=small_table)
    for episode in range(2):
        env.reset(seed=episode)
        changed = []
        for _ in range(20):
            _, _, terminated, truncated, info = env.step(np.array([0.0, 1.0], np.float32))
            changed.append(info["changed"])
        assert not terminated
        assert max(changed) == 1.0
    assert truncated


def test_mistakes_are_told_in_a_sentence(make):
    with pytest.raises(ConfigurationError, match="choose continuous or planner"):
        make(actions="five")
    with pytest.raises(ConfigurationError, match="cars = 0"):
        make(cars=0)
    with pytest.raises(ConfigurationError, match=r"call it before step"):
        make().step(np.zeros(2, np.float32))
    env = make()
    env.reset(seed=0)
    with pytest.raises(ConfigurationError, match="is none of"):
        env.step(np.array([0.0, 7.0], np.float32))
    env.close()
    with pytest.raises(ConfigurationError, match="filters hj_cosim/Highway-v0, not a"):
        SafetyFilterWrapper(gymnasium.make("CartPole-v1"))
