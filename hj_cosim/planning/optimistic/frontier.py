"""The frontier of a search: a binary heap of leaves, the one that is expanded next on top.

Two arrays hold it, the leaves' upper bounds and their nodes; `leaves` is how many of their entries are in use.
"""

import numpy as np

from hj_cosim.kernels import kernel


@kernel
def comes_first(bound: float, node: int, other_bound: float, other: int, nodes: np.ndarray) -> bool:
    """Return whether a leaf is expanded before another: the higher bound, then the shallower, then the older."""
    if bound != other_bound:
        return bound > other_bound
    if nodes[node].depth != nodes[other].depth:
        return nodes[node].depth < nodes[other].depth
    return node < other


@kernel
def push_leaf(bounds: np.ndarray, heap: np.ndarray, nodes: np.ndarray, leaves: int, node: int, bound: float) -> int:
    """Put a leaf on the frontier, a heap of `leaves`, and return how many it now has."""
    place = leaves
    while place > 0:
        above = (place - 1) // 2
        if not comes_first(bound, node, bounds[above], heap[above], nodes):
            break
        bounds[place], heap[place] = bounds[above], heap[above]
        place = above
    bounds[place], heap[place] = bound, node
    return leaves + 1


@kernel
def pop_leaf(bounds: np.ndarray, heap: np.ndarray, nodes: np.ndarray, leaves: int) -> int:
    """Take the first leaf off the frontier, a heap of `leaves`, and return how many are left."""
    last = leaves - 1
    bound, node = bounds[last], heap[last]
    place = 0
    while True:
        below = 2 * place + 1
        if below >= last:
            break
        if below + 1 < last and comes_first(bounds[below + 1], heap[below + 1], bounds[below], heap[below], nodes):
            below += 1
        if not comes_first(bounds[below], heap[below], bound, node, nodes):
            break
        bounds[place], heap[place] = bounds[below], heap[below]
        place = below
    bounds[place], heap[place] = bound, node
    return last
