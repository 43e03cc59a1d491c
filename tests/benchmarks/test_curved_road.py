"""What an episode costs on a road that bends beside the same traffic on a straight one of as many lanes."""

import time

import numpy as np

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import run_in_sumo
from hj_cosim.reachability.table.store import load_table
from hj_cosim.traffic.sources.scenarios import scenario_data

SEEDS = (0, 1, 2, 3, 4)
BENT = "curves"


def straight_network(lanes: int) -> str:
    """Return a network of one straight edge of 10 km, as the scenarios have theirs."""
    shapes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" speed="60" length="10000" width="3.5"'
        f' shape="0,{3.5 * lane} 10000,{3.5 * lane}"/>'
        for lane in range(lanes)
    )
    return (
        '<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
        f' projParameter="!"/><edge id="highway" from="a" to="b" priority="1">{shapes}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        '<junction id="b" type="dead_end" x="10000" y="0" incLanes="" intLanes="" shape="10000,0 10000,1"/></net>'
    )


def test_a_curved_road_beside_a_straight_one(row, tmp_path):
    table = load_table("highway")
    (tmp_path / "straight.net.xml").write_text(straight_network(3))
    bent = scenario_data(BENT)
    straight = {**bent, "network": {"file": str(tmp_path / "straight.net.xml")}}
    taken: dict[str, list[float]] = {"bent": [], "straight": []}
    for seed in (*SEEDS[:1], *SEEDS):  # the first pair loads every kernel
        for name, scenario in (("bent", bent), ("straight", straight)):
            config = resolve_config(scenario, flags={"seed": seed, "simulation": {"on_collision": "continue"}})
            started = time.process_time()
            episode = run_in_sumo(config, table)
            # Of each second driven, for a drive may end before its time.
            taken[name].append((time.process_time() - started) / episode.record.time[-1])
    ratios = np.array(taken["bent"][1:]) / np.array(taken["straight"][1:])
    print(
        f"\nCPU seconds a second driven: {np.median(taken['bent'][1:]):.4f} bent,"
        f" {np.median(taken['straight'][1:]):.4f} straight; {ratios.min():.2f} to {ratios.max():.2f} times"
    )
    row("curved road", np.median(ratios))
