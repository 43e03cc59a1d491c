"""Where a route stops being a road: at a light, where others have the right of way, where they cross."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hj_cosim.errors import NetworkError
from hj_cosim.traffic.net_file import read_elements


class _Link(NamedTuple):
    """A way through a junction, from lane to lane."""

    source: str
    target: str
    via: str  # the lane inside the junction; empty if the network has none
    light: str  # the traffic light that rules it; empty if none does


class _Rules(NamedTuple):
    """What a junction asks of one of its links; links by their place in its list, as bits."""

    yields_to: int
    meets: int


@dataclass(frozen=True)
class Junctions:
    """The ways through a network's junctions, and who gives way to whom."""

    path: Path
    links: dict[tuple[str, str], list[_Link]]
    rules: dict[str, tuple[str, _Rules]]  # by the lane inside: the junction, and what it asks
    targets: dict[str, list[str]]  # by junction: the edge that each of its links leads to

    def obstacle(self, source: str, target: str) -> str | None:
        """Return why nobody drives on from an edge to the next as along a road; None where one does."""
        links = self.links.get((source, target), [])
        for link in links:
            if link.light:
                return f"traffic light {link.light!r}"
        for link in links:
            junction, rules = self._rules_of(link)
            if rules.yields_to:
                return f"junction {junction!r}, where others have the right of way"
            crossing = [
                other
                for place, other in enumerate(self.targets.get(junction, ()))
                if rules.meets >> place & 1 and other != link.target
            ]
            if crossing:
                return f"junction {junction!r}, where others cross on their way to {crossing[0]!r}"
        return None

    def before(self, edge: str) -> str | None:
        """Return the edge that leads to `edge` by the most lanes as a road does; None if none does."""
        lanes: dict[str, int] = {}
        for (source, target), links in self.links.items():
            if target == edge and not source.startswith(":") and self.obstacle(source, edge) is None:
                lanes[source] = len(links)
        return max(sorted(lanes), key=lanes.__getitem__, default=None)

    def after(self, edge: str) -> str | None:
        """Return the edge to which `edge` leads by the most lanes as a road does; None if it leads to none."""
        lanes: dict[str, int] = {}
        for (source, target), links in self.links.items():
            if source == edge and self.obstacle(edge, target) is None:
                lanes[target] = len(links)
        return max(sorted(lanes), key=lanes.__getitem__, default=None)

    def _rules_of(self, link: _Link) -> tuple[str, _Rules]:
        """Return a link's junction, and what that asks; it knows a link by its first lane inside or the next."""
        via = link.via
        while via:
            if via in self.rules:
                return self.rules[via]
            onward = self.links.get((via.rpartition("_")[0], link.target), [])
            via = onward[0].via if onward else ""
        return "", _Rules(0, 0)

    def as_far_as_it_is_a_road(self, route: Sequence[str]) -> tuple[tuple[str, ...], str | None]:
        """Return the first edges of a route, up to the first obstacle, and that; None if there is none."""
        for place in range(1, len(route)):
            obstacle = self.obstacle(route[place - 1], route[place])
            if obstacle is not None:
                return tuple(route[:place]), obstacle
        return tuple(route), None


def read_junctions(path: Path) -> Junctions:
    """Return the junctions of the network at `path`.

    Raises:
        NetworkError: if the file is missing or malformed, traffic keeps to the left in it, or its junctions have no
            lanes inside them.
    """
    links: dict[tuple[str, str], list[_Link]] = defaultdict(list)
    inside: dict[str, list[str]] = {}  # by junction: its links' lanes
    rules: dict[str, list[_Rules]] = defaultdict(list)
    junction = ""
    is_left_handed = False

    def on_element(name: str, attributes: dict[str, str]) -> None:
        nonlocal junction, is_left_handed
        if name == "net":
            is_left_handed = attributes.get("lefthand") in ("true", "1")
        elif name == "connection":
            link = _Link(attributes["from"], attributes["to"], attributes.get("via", ""), attributes.get("tl", ""))
            links[link.source, link.target].append(link)
        elif name == "junction":
            junction = attributes["id"]
            inside[junction] = attributes.get("intLanes", "").split()
        elif name == "request":
            rules[junction].append(_Rules(int(attributes["response"], 2), int(attributes["foes"], 2)))

    read_elements(path, on_element, "a junction")
    if is_left_handed:
        raise NetworkError(f"{path}: traffic keeps to the left there, where lanes count from the other side; not yet")
    outer = [link for (source, _), each in links.items() if not source.startswith(":") for link in each]
    if outer and not any(link.via for link in outer):
        raise NetworkError(
            f"{path} has no lanes inside its junctions, where SUMO loses who is moved from outside; make it anew with"
            " netconvert --sumo-net-file OLD.net.xml --output-file NEW.net.xml --no-internal-links false"
        )
    target_of = {link.via: link.target for link in outer if link.via}
    found = {
        via: (name, rules[name][place])
        for name, lanes in inside.items()
        for place, via in enumerate(lanes)
        if place < len(rules[name])
    }
    targets = {name: [target_of.get(via, "") for via in lanes] for name, lanes in inside.items()}
    return Junctions(path, dict(links), found, targets)
