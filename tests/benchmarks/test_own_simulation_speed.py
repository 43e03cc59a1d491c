"""What a robot costs in a user's simulation of 50 to 5,000 vehicles, beside SUMO's own steps of the same length.

Some 30 vehicles are within 250 m of the robot, however many there are: the road, of edges of 1 km, is as long as that
takes. Only who is near is read, in one context subscription, which SUMO answers within its step; so what a robot costs
is the whole time of a step less that of SUMO alone, the same traffic with the robot's vehicle still in it.
"""

import time
from pathlib import Path

import libsumo
import matplotlib
import numpy as np
from traci import constants

from hj_cosim.settings import OwnSimulationSettings, RobotSettings, Scenario
from hj_cosim.traffic.sumo.own_world import OwnWorld
from hj_cosim.traffic.sumo.puppet import ROBOT

matplotlib.use("Agg")

STEP, TRAFFIC_STEP = 0.02, 0.1
COUNTS = (50, 200, 500, 1000, 2000, 5000)
PER_KILOMETRE = 60.0  # vehicles on four lanes: 30 within 250 m
EDGE, SPEED = 1000.0, 24.0  # m, m/s
BLOCK, BLOCKS = 25, 7  # steps of SUMO's that are timed at once, and how often
GROWTH = Path(".benchmarks") / "own_simulation_growth"  # .csv, the table, and .png, the plot
COLUMNS = "vehicles,near,bare_us,whole_us,outside_us,share,by_us_whole_us,by_us_outside_us,by_us_share"
ALLOWED = {1000: 0.5, 5000: 0.2}

clock = time.process_time


def configuration(folder: Path, count: int) -> Path:
    """Write a straight motorway of four lanes with `count` vehicles on it, each with a route to its end."""
    folder.mkdir()
    edges = max(round(count / PER_KILOMETRE * 1000.0 / EDGE), 1) + 3  # and where they drive to meanwhile
    lines = [
        '<net version="1.20" junctionCornerDetail="5">',
        f'<location netOffset="0,0" convBoundary="0,0,{edges * EDGE},16"',
    ]
    lines[-1] += ' origBoundary="0,0,1,1" projParameter="!"/>'
    for number in range(edges):
        start = number * EDGE
        lanes = "".join(
            f'<lane id="e{number}_{lane}" index="{lane}" speed="40" length="{EDGE - 1.0}" width="4"'
            f' shape="{start},{4 * lane} {start + EDGE - 1.0},{4 * lane}"/>'
            for lane in range(4)
        )
        lines.append(f'<edge id="e{number}" from="j{number}" to="j{number + 1}" priority="1">{lanes}</edge>')
        if number + 1 < edges:
            inner = "".join(
                f'<lane id=":j{number + 1}_0_{lane}" index="{lane}" speed="40" length="1" width="4"'
                f' shape="{start + EDGE - 1.0},{4 * lane} {start + EDGE},{4 * lane}"/>'
                for lane in range(4)
            )
            lines.insert(2, f'<edge id=":j{number + 1}_0" function="internal">{inner}</edge>')
    for number in range(edges + 1):
        x = number * EDGE
        inside = 0 < number < edges
        coming = " ".join(f"e{number - 1}_{lane}" for lane in range(4)) if number else ""
        within = " ".join(f":j{number}_0_{lane}" for lane in range(4)) if inside else ""
        kind = "priority" if inside else "dead_end"
        requests = "".join(f'<request index="{lane}" response="0000" foes="0000" cont="0"/>' for lane in range(4))
        lines.append(
            f'<junction id="j{number}" type="{kind}" x="{x}" y="0" incLanes="{coming}" intLanes="{within}"'
            f' shape="{x},-2 {x},14">{requests if inside else ""}</junction>'
        )
    for number in range(edges - 1):
        for lane in range(4):
            lines.append(
                f'<connection from="e{number}" to="e{number + 1}" fromLane="{lane}" toLane="{lane}"'
                f' via=":j{number + 1}_0_{lane}" dir="s" state="M"/>'
                f'<connection from=":j{number + 1}_0" to="e{number + 1}" fromLane="{lane}" toLane="{lane}" dir="s"'
                ' state="M"/>'
            )
    (folder / "long.net.xml").write_text("\n".join([*lines, "</net>"]))
    draw = np.random.default_rng(0)
    rows = []
    for car in range(count):
        place = car // 4 * (4.0 / PER_KILOMETRE * 1000.0) + draw.uniform(0.0, 20.0) + 10.0
        edge = int(place // EDGE)
        route = " ".join(f"e{number}" for number in range(edge, edges))
        rows.append(
            f'<vehicle id="v{car}" type="car" depart="0" departLane="{car % 4}" departSpeed="{SPEED}"'
            f' departPos="{min(place - edge * EDGE, EDGE - 2.0):.1f}"><route edges="{route}"/></vehicle>'
        )
    types = '<vType id="car" carFollowModel="IDM" maxSpeed="26" speedFactor="1" speedDev="0"/>'
    (folder / "cars.rou.xml").write_text("\n".join(["<routes>", types, *rows, "</routes>"]))
    path = folder / "long.sumocfg"
    path.write_text(
        '<configuration><input><net-file value="long.net.xml"/><route-files value="cars.rou.xml"/></input>'
        '<time><begin value="0"/><end value="400"/><step-length value="0.1"/></time></configuration>'
    )
    return path


def opened(path: Path, count: int, traffic: str) -> OwnWorld:
    ego = f"v{count // 2}"  # in their middle
    own = OwnSimulationSettings(file=str(path), ego=ego, begin=5.0, traffic=traffic)
    return OwnWorld(Scenario(name="growth", own=own), RobotSettings(), 0, STEP, TRAFFIC_STEP)


def whole(path: Path, count: int, traffic: str, monkeypatch) -> tuple[float, float, float]:
    """Return seconds of a step of SUMO's with the robot's five in it, those outside SUMO, and how many are near."""
    inside, sumos_step = 0.0, libsumo.simulationStep

    def timed_step() -> None:
        nonlocal inside
        started = clock()
        sumos_step()
        inside += clock() - started

    ratio = round(TRAFFIC_STEP / STEP)
    with opened(path, count, traffic) as world, monkeypatch.context() as patch:
        patch.setattr(libsumo, "simulationStep", timed_step)
        seen, blocks, outside, near = world.observe(), [], [], []
        for _ in range(BLOCKS):
            inside, started = 0.0, clock()
            for _ in range(BLOCK * ratio):
                x, y, _, speed = seen.robot.tolist()
                world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)
                seen = world.observe()
            seconds = clock() - started
            blocks.append(seconds / BLOCK)
            outside.append((seconds - inside) / BLOCK)
            near.append(len(seen.x))
    return float(np.median(blocks)), float(np.median(outside)), float(np.mean(near))


def bare(path: Path, count: int, traffic: str) -> float:
    """Return seconds of a step of SUMO alone: the same traffic from the same instant, nobody read."""
    with opened(path, count, traffic):
        libsumo.vehicle.unsubscribeContext(ROBOT, constants.CMD_GET_VEHICLE_VARIABLE, 250.0)
        libsumo.vehicle.setSpeed(ROBOT, SPEED)
        blocks = []
        for _ in range(BLOCKS):
            started = clock()
            for _ in range(BLOCK):
                libsumo.simulationStep()
            blocks.append((clock() - started) / BLOCK)
    return float(np.median(blocks))


def test_what_a_robot_costs_in_a_users_simulation(row, tmp_path, monkeypatch):
    rows = []
    print("\nvehicles | near | SUMO alone µs/step | whole | outside SUMO | our share | by us: whole, outside, share")
    for count in COUNTS:
        path = configuration(tmp_path / str(count), count)
        found = [float(count)]
        for traffic in ("theirs", "idm-mobil"):
            alone = bare(path, count, traffic)
            total, outside, near = whole(path, count, traffic, monkeypatch)
            found += [near, 1e6 * alone] if traffic == "theirs" else []
            found += [1e6 * total, 1e6 * outside, (total - alone) / alone]
        rows.append(found)
        line = "{:8.0f} | {:4.0f} | {:18.0f} | {:5.0f} | {:5.0f} | {:5.2f} | {:6.0f}, {:5.0f}, {:5.2f}"
        print(line.format(*found), flush=True)
    table = np.array(rows)
    GROWTH.parent.mkdir(exist_ok=True)
    np.savetxt(GROWTH.with_suffix(".csv"), table, fmt="%.3f", delimiter=",", header=COLUMNS, comments="")
    _plot(table)
    shares = dict(zip(COUNTS, table[:, 5], strict=True))
    row("share of 5000", shares[5000])
    assert {count: shares[count] <= allowed for count, allowed in ALLOWED.items()} == dict.fromkeys(ALLOWED, True)


def _plot(table: np.ndarray) -> None:
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for column, label in (
        (2, "SUMO alone"),
        (3, "with the robot"),
        (4, "outside SUMO's step"),
        (6, "with IDM and MOBIL"),
    ):
        left.loglog(table[:, 0], table[:, column], marker="o", label=label)
    left.set(xlabel="vehicles in the network", ylabel="µs per step of 0.1 s")
    for column, label in ((5, "their drivers"), (8, "IDM and MOBIL")):
        right.loglog(table[:, 0], table[:, column], marker="o", label=label)
    right.loglog(list(ALLOWED), list(ALLOWED.values()), "k_", markersize=12, label="to reach")
    right.set(xlabel="vehicles in the network", ylabel="our share of SUMO's own time")
    for axes in (left, right):
        axes.grid(which="both", alpha=0.3)
        axes.legend()
    figure.savefig(GROWTH.with_suffix(".png"), dpi=150)
    pyplot.close(figure)
