"""The safety filter, and the parameters of the RSS distances."""

from typing import Any, Literal

from pydantic import Field

from hj_cosim.settings.base import Metres, MetresPerSecondSquared, Number, PerSecond, Seconds, Settings

Backend = Literal["daqp", "osqp", "quadprog", "piqp", "clarabel", "enumeration"]


class RssParameters(Settings):
    """Parameters of the RSS distances (Shalev-Shwartz et al. 2017)."""

    response_time: Seconds = Field(0.3, ge=0, description="ρ, until the rear car answers")
    acceleration: MetresPerSecondSquared = Field(
        3.0, ge=0, description="a_accel, how hard the rear car may accelerate during the response time"
    )
    brake_min: MetresPerSecondSquared = Field(6.0, gt=0, description="b_min, what the rear car brakes at least")
    brake_max: MetresPerSecondSquared = Field(6.0, gt=0, description="b_max, what the front car brakes at most")
    lateral_acceleration: MetresPerSecondSquared = Field(
        0.2, ge=0, description="how hard both may accelerate towards each other during the response time"
    )
    lateral_brake: MetresPerSecondSquared = Field(0.8, gt=0, description="how hard both stop that at least")
    lateral_margin: Metres = Field(0.1, ge=0, description="μ, the distance that remains between the sides")


class FilterSettings(Settings):
    """The safety filter between the tracking controller and the robot."""

    kind: str = Field(
        "spc",
        description="spc, rss, none, a name that a package registers, FILE.py:Class or package.module:Class",
        examples=["spc", "rss", "none"],
    )
    scheme: Literal["mi", "sw"] = Field(
        "mi", description="what is done about it: minimal intervention, or switching to the safest control"
    )
    epsilon: Metres = Field(2.0, ge=0, description="ε, a car with V <= ε is in K")
    recovery: PerSecond = Field(
        0.0, ge=0, le=50, description="κ: below ε V has to rise by κ (ε − V), κ ε at most; the paper has 0"
    )
    approach: PerSecond = Field(
        0.0,
        ge=0,
        le=50,
        description="γ: above ε V may fall, the faster the more of it is left, γ (V − ε) to begin with, so that a row"
        " begins before it binds; with 0, the paper's, nothing is asked above ε",
    )
    smooth_gradient: bool = Field(
        False, description="slopes of V are those of its mean over a cell of the table, and do not jump between cells"
    )
    slack_weight: Number = Field(10.0, gt=0, description="λ_3; the paper has 1")
    keep_on_road: bool = Field(
        False,
        description="SPC and RSS turn no farther than the robot can turn back before the road's edge; not in the paper",
    )
    keep_escape: bool = Field(
        False,
        description="SPC's control gives way to an escaping manoeuvre where it would leave none; not in the paper",
    )
    evade: bool = Field(
        False,
        description="with keep_escape: where a car breaks a duty that the table counts on, SPC's control gives way at"
        " the last moment to a manoeuvre that keeps the bodies apart if all go on as they do, and if that car comes at"
        " the robot; not in the paper",
    )
    priority: Literal["equal", "belief"] = Field(
        "equal",
        description="equal: all cars are taken for what the table's game assumes; belief: of those whose driving so far"
        " says that they mean harm, SPC assumes the worst (table highway_worst)",
    )
    suspect_weight: Number = Field(
        0.3, gt=0, description="by belief: how much missing a suspected car's row counts where all cannot be met"
    )
    conflicts: Literal["equal", "responsibility"] = Field(
        "equal",
        description="where the rows cannot be met together; equal: all are missed alike, as in the paper;"
        " responsibility: those least for whom the robot answers by RSS, then those with least left of V",
    )
    solver: Backend = Field(
        "daqp",
        description="of the filter's problem, one of qpsolvers' or this project's own enumeration, which is exact and"
        " the quickest; quadprog may never end where many cars are at one place",
    )
    rss: RssParameters = Field(
        RssParameters(response_time=0.5, brake_min=4.0, brake_max=8.0), description="of the filter rss"
    )
    options: dict[str, Any] = Field({}, description="settings that a filter of one's own brings")
