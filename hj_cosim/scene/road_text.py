"""Roads as text, as a run's trajectories carry them: what is written, and what is accepted from anybody."""

import itertools
import json
from dataclasses import asdict, fields
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from hj_cosim.scene.road import Road, StraightRoad

MOST_LANES = 100
WIDEST_LANE = 100.0  # m
FARTHEST_PLACE = 1e9  # m
MOST_KNOTS = 1_000_000

_Finite = Annotated[float, Field(ge=-FARTHEST_PLACE, le=FARTHEST_PLACE)]


class _WrittenRoute(BaseModel):
    """What the text of a RouteRoad has to hold."""

    model_config = ConfigDict(extra="forbid")

    lane_count: int = Field(ge=1, le=MOST_LANES)
    lane_width: float = Field(gt=0.0, le=WIDEST_LANE)
    length: float = Field(gt=0.0, le=FARTHEST_PLACE)
    knots: list[tuple[_Finite, _Finite]] = Field(min_length=4, max_length=MOST_KNOTS)
    reference_lane: int = Field(ge=0, lt=MOST_LANES)
    section_start: list[_Finite] = Field(min_length=1, max_length=MOST_KNOTS)
    first_lane: list[Annotated[int, Field(ge=0, lt=MOST_LANES)]]
    lanes_there: list[Annotated[int, Field(ge=1, le=MOST_LANES)]]
    leading_off: list[Annotated[int, Field(ge=0)]]
    lap: float = Field(ge=0.0, le=FARTHEST_PLACE)
    limit_start: list[_Finite] = Field(default=[], max_length=MOST_KNOTS)
    limit: list[Annotated[float, Field(gt=0.0, le=FARTHEST_PLACE)]] = []

    @model_validator(mode="after")
    def _is_consistent(self) -> "_WrittenRoute":
        starts = self.section_start
        if not len(starts) == len(self.first_lane) == len(self.lanes_there) == len(self.leading_off):
            raise ValueError("section_start, first_lane, lanes_there and leading_off must be equally long")
        if starts[0] != 0.0 or any(later <= earlier for earlier, later in itertools.pairwise(starts)):
            raise ValueError("section_start must begin with 0 and grow")
        if max(map(sum, zip(self.first_lane, self.lanes_there, strict=True))) > self.lane_count:
            raise ValueError("first_lane and lanes_there name more lanes than lane_count")
        if self.lap and self.knots[0] != self.knots[-1]:
            raise ValueError("knots of a closed road must end where they begin")
        knots = np.array(self.knots)
        steps = np.hypot(*np.diff(knots, axis=0).T)
        if not steps.min() > 0.5 * steps.max():
            raise ValueError("knots must be evenly spaced")
        return self


def road_to_json(road: Road) -> str:
    """Return a road as the text that `road_from_json` reads.

    Raises:
        TypeError: if it is a kind of road that has no such text.
    """
    if isinstance(road, StraightRoad):
        return json.dumps(asdict(road))
    # Numba and SciPy, with which a route is looked up, take longer to import than a straight drive to read.
    from hj_cosim.scene.route_road import RouteRoad

    if isinstance(road, RouteRoad):
        return json.dumps({each.name: _plain(getattr(road, each.name)) for each in fields(road)})
    raise TypeError(f"only straight roads and routes can be written, not a {type(road).__name__}")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def road_from_json(text: str | bytes) -> Road:
    """Return the road that a text of `road_to_json` describes.

    Raises:
        ValueError: if it describes none, or one that no drive can have been on.
    """
    try:
        if b'"knots"' in (text.encode() if isinstance(text, str) else text):
            from hj_cosim.scene.route_road import RouteRoad  # as above

            written = _WrittenRoute.model_validate_json(text)
            return RouteRoad(
                lane_count=written.lane_count,
                lane_width=written.lane_width,
                length=written.length,
                knots=np.array(written.knots),
                reference_lane=written.reference_lane,
                section_start=np.array(written.section_start),
                first_lane=np.array(written.first_lane),
                lanes_there=np.array(written.lanes_there),
                leading_off=np.array(written.leading_off),
                lap=written.lap,
                limit_start=np.array(written.limit_start),
                limit=np.array(written.limit),
            )
        road = TypeAdapter(StraightRoad).validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "the whole"
        raise ValueError(f"it does not describe a road: {key}: {first['msg']}") from error
    return road
