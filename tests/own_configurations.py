"""Small simulations such as users have: a network of straight edges, demand, types, detectors, and a configuration."""

from collections.abc import Sequence
from pathlib import Path

LANE_WIDTH = 3.5
JUNCTION = 4.0  # m, between two edges

TYPES = """
<vType id="car" vClass="passenger" carFollowModel="Krauss" sigma="0.5" length="4.5" width="1.8" maxSpeed="33"/>
<vType id="lorry" vClass="truck" carFollowModel="IDM" length="14" width="2.5" maxSpeed="23"/>
"""
DEMAND = """
<flow id="cars" type="car" route="way" begin="0" end="300" period="3" departLane="random" departSpeed="20"/>
<flow id="lorries" type="lorry" route="way" begin="1" end="300" period="11" departLane="0" departSpeed="20"/>
"""
# What writes, in each way that there is.
DETECTORS = """<additional>
<inductionLoop id="loop" lane="e0_0" pos="100" period="10" file="loops.xml"/>
<laneAreaDetector id="area" lane="e0_0" pos="50" endPos="90" period="10" file="sub/areas.xml"/>
<edgeData id="means" file="means.xml" period="10"/>
<timedEvent type="SaveTLSSwitchStates" dest="lights.xml"/>
</additional>"""
OUTPUTS = """
<fcd-output value="fcd.xml"/>
<tripinfo-output value="trips.xml"/>
<summary value="summary.xml"/>
<log value="sumo.log"/>
<output-prefix value="my-"/>
<save-state.times value="12"/>
<save-state.files value="states.xml"/>
"""


def network(
    path: Path,
    lengths: Sequence[float] = (600.0, 600.0),
    lanes: int = 2,
    *,
    light: str = "",
    request: str = "",
    root: str = "",
    inside: bool = True,
) -> Path:
    """Write straight edges e0, e1, ... one behind the other along +x, joined by junctions j1, j2, ...

    Args:
        path: where to.
        lengths: of the edges, m.
        lanes: of each.
        light: a traffic light at the last junction but the end.
        request: what the last but the end asks of each of its links: `response` and `foes` as the network has them,
            with links of its own that nobody drives.
        root: attributes of <net>.
        inside: whether junctions have lanes inside them.
    """
    edges, junctions, connections, start = [], [], [], 0.0

    def shape(begin: float, end: float, lane: int) -> str:
        y = LANE_WIDTH * (lane + 0.5 - lanes)
        return f"{begin},{y} {end},{y}"

    def edge(name: str, begin: float, end: float, rest: str) -> str:
        inner = "".join(
            f'<lane id="{name}_{lane}" index="{lane}" speed="36" length="{end - begin}" width="{LANE_WIDTH}"'
            f' shape="{shape(begin, end, lane)}"/>'
            for lane in range(lanes)
        )
        return f'<edge id="{name}" {rest}>{inner}</edge>'

    last = len(lengths) - 1
    junctions.append('<junction id="j0" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>')
    for number, length in enumerate(lengths):
        end = start + length
        edges.append(edge(f"e{number}", start, end, f'from="j{number}" to="j{number + 1}" priority="1"'))
        name, coming = f"j{number + 1}", " ".join(f"e{number}_{lane}" for lane in range(lanes))
        if number == last:
            junctions.append(
                f'<junction id="{name}" type="dead_end" x="{end}" y="0" incLanes="{coming}" intLanes=""'
                f' shape="{end},0 {end},1"/>'
            )
            break
        is_special = number == last - 1
        if inside:
            edges.append(edge(f":{name}_0", end, end + JUNCTION, 'function="internal"'))
        asked = request if request and is_special else f'response="{"0" * lanes}" foes="{"0" * lanes}"'
        inner = " ".join(f":{name}_0_{lane}" for lane in range(lanes)) if inside else ""
        requests = "".join(f'<request index="{lane}" {asked} cont="0"/>' for lane in range(lanes)) if inside else ""
        kind = "traffic_light" if light and is_special else "priority"
        junctions.append(
            f'<junction id="{name}" type="{kind}" x="{end}" y="0" incLanes="{coming}" intLanes="{inner}"'
            f' shape="{end},-9 {end + JUNCTION},0">{requests}</junction>'
        )
        for lane in range(lanes):
            via = f' via=":{name}_0_{lane}"' if inside else ""
            signal = f' tl="{light}" linkIndex="{lane}"' if light and is_special else ""
            onward = f'to="e{number + 1}" fromLane="{lane}" toLane="{lane}" dir="s"'
            connections.append(f'<connection from="e{number}" {onward}{via}{signal} state="M"/>')
            if inside:
                connections.append(f'<connection from=":{name}_0" {onward} state="M"/>')
        start = end + (JUNCTION if inside else 0.0)
    phases = f'<phase duration="20" state="{"G" * lanes}"/><phase duration="20" state="{"r" * lanes}"/>'
    lights = f'<tlLogic id="{light}" type="static" programID="0" offset="0">{phases}</tlLogic>' if light else ""
    path.write_text(
        f'<net version="1.20" {root}><location netOffset="0,0" convBoundary="0,-9,{end},0" origBoundary="0,0,1,1"'
        f' projParameter="!"/>{"".join(edges)}{lights}{"".join(junctions)}{"".join(connections)}</net>'
    )
    return path


def simulation(folder: Path, *, demand: str = DEMAND, options: str = OUTPUTS, **net: object) -> Path:
    """Write a whole simulation into `folder` and return its configuration; `net` is for `network`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "in").mkdir(exist_ok=True)
    lengths = net.get("lengths", (600.0, 600.0))
    network(folder / "in" / "road.net.xml", **net)
    route = " ".join(f"e{number}" for number in range(len(lengths)))  # type: ignore[arg-type]
    (folder / "in" / "cars.rou.xml").write_text(
        f'<routes>{TYPES}<route id="way" edges="{route}"/><route id="short" edges="e0"/>{demand}</routes>'
    )
    (folder / "in" / "detectors.add.xml").write_text(DETECTORS)
    configuration = folder / "mine.sumocfg"
    configuration.write_text(
        "<configuration><input>"
        '<net-file value="in/road.net.xml"/><route-files value="in/cars.rou.xml"/>'
        '<additional-files value="in/detectors.add.xml"/></input>'
        '<time><begin value="0"/><end value="400"/><step-length value="0.5"/></time>'
        '<processing><lateral-resolution value="0.8"/></processing>'
        f"<output>{options}</output><report><verbose value='true'/></report></configuration>"
    )
    return configuration


def content(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder, by its path there."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
