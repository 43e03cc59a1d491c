"""Write what hj_reachability computes, so that the tests can compare without it.

    python tests/reachability/make_peer_fixtures.py

Takes minutes and needs the extra `peers`.
"""

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import peer_cases  # noqa: E402
from peer import solve_with_peer  # noqa: E402


def main() -> None:
    fixtures = HERE / "fixtures"
    np.savez_compressed(fixtures / "peer_air3d.npz", values=solve_with_peer(peer_cases.air3d()))
    for scheme in ("first_order", "eno2", "weno3", "weno5"):
        specification = peer_cases.highway(scheme)
        values = solve_with_peer(specification)
        nodes = peer_cases.sampled_nodes(values.shape, 20_000)
        np.savez_compressed(fixtures / f"peer_highway_{scheme}.npz", values=values.reshape(-1)[nodes])


if __name__ == "__main__":
    main()
