"""Learning to drive: the highway as a Gymnasium environment, and the safety filter as a wrapper of it.

Needs the extra `gym`: pip install 'hj-cosim[gym]'. Where the package is installed, `gymnasium.make` knows
`hj_cosim/Highway-v0`; from a clone that is not, `gymnasium.make("hj_cosim.training:hj_cosim/Highway-v0")` finds it.
"""

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("hj_cosim.training needs gymnasium: pip install 'hj-cosim[gym]'") from error

ENVIRONMENT = "hj_cosim/Highway-v0"


def register() -> None:
    """Make the environment known to Gymnasium; a second time does nothing."""
    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(ENVIRONMENT, entry_point="hj_cosim.training.environment:HighwayEnv")


register()
