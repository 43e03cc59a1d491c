"""What all groups of settings have in common, and the units that their numbers are in."""

from dataclasses import dataclass
from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict
from pydantic.fields import FieldInfo


class Settings(BaseModel):
    """A group of settings: frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True)
class Unit:
    """The unit of a number, as a part of its type: `length: Metres` is `Annotated[float, Unit("m")]`."""

    symbol: str  # "1" of a number without one


Number = Annotated[float, Unit("1")]
Metres = Annotated[float, Unit("m")]
Seconds = Annotated[float, Unit("s")]
PerSecond = Annotated[float, Unit("1/s")]
Radians = Annotated[float, Unit("rad")]
RadiansPerSecond = Annotated[float, Unit("rad/s")]
MetresPerSecond = Annotated[float, Unit("m/s")]
MetresPerSecondSquared = Annotated[float, Unit("m/s²")]
MetresPerSecondCubed = Annotated[float, Unit("m/s³")]
CarsPerKilometreAndLane = Annotated[float, Unit("cars/km/lane")]
CarsPerHour = Annotated[float, Unit("cars/h")]


def unit_of(field: FieldInfo) -> str | None:
    """Return the unit of a setting, "1" where it has none; None where nothing is declared."""
    metadata: list[Any] = list(field.metadata)
    for part in get_args(field.annotation):  # of `Metres | None`
        metadata += getattr(part, "__metadata__", ())
    return next((entry.symbol for entry in metadata if isinstance(entry, Unit)), None)


def explanation(field: FieldInfo) -> str:
    """Return a setting's unit, if it has one, and its description."""
    unit = unit_of(field)
    return ", ".join(part for part in (None if unit == "1" else unit, field.description) if part)
