"""What all suites share: the error, and how to tell whether something was written to."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import fields
from typing import TypeVar

import numpy as np

from hj_cosim.errors import HjCosimError, PluginError
from hj_cosim.scene.observation import CarValues, Observation

Answer = TypeVar("Answer")


class ContractError(AssertionError):
    """A class breaks its contract; one sentence says how."""


def require(holds: bool, sentence: str) -> None:
    """Raise ContractError with a sentence unless something holds."""
    if not holds:
        raise ContractError(sentence)


def answered(ask: Callable[[], Answer], when: str) -> Answer:
    """Return an answer that is asked for.

    Args:
        ask: asks.
        when: ends the sentence, as "in an empty scene".

    Raises:
        ContractError: if asking fails.
    """
    try:
        return ask()
    except (PluginError, HjCosimError) as error:
        raise ContractError(f"{error}; {when}") from error


@contextmanager
def left_as_it_was(name: str, *given: Observation | CarValues) -> Iterator[None]:
    """Check that what is handed to somebody in the block is not written to.

    Args:
        name: of the method, in the sentence.
        given: what is handed over.

    Raises:
        ContractError: if an array of it has changed.
    """
    before = [{field.name: deepcopy(getattr(each, field.name)) for field in fields(each)} for each in given]
    yield
    for each, kept in zip(given, before, strict=True):
        for key, value in kept.items():
            now = getattr(each, key)
            same = now is None if value is None else np.array_equal(now, value, equal_nan=True)
            require(same, f"{name} wrote to {type(each).__name__}.{key}; what is handed over is not to be changed")
