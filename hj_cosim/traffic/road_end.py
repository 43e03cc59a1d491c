"""Where a drive ends because its road does."""

from dataclasses import dataclass

from hj_cosim.errors import DriveEnded
from hj_cosim.scene.road import Road

END_OF_THE_ROAD = "end of the road"


def require_road(road: Road, front: float, time: float) -> None:
    """Check that the robot is still on the road.

    Args:
        road: the road.
        front: arc length (m) of the middle of the robot's front bumper.
        time: s since the robot took over, for the message.

    Raises:
        DriveEnded: if the road ends before that.
    """
    if front > road.length:
        raise DriveEnded(
            END_OF_THE_ROAD,
            f"the robot reached the end of the road ({road.length:.0f} m) after {time:.2f} s;"
            " take a longer road or a shorter simulation.duration",
        )


@dataclass(frozen=True)
class RoadEnd:
    """Where a drive through a larger network ends, and what is there."""

    along: float  # s, m
    reason: str  # a few words: a junction, a light, the end of a vehicle's route
    remedy: str  # what would let the robot drive on, for the message

    def require(self, front: float, time: float) -> None:
        """Check that the robot has not come so far; arguments as for require_road.

        Raises:
            DriveEnded: if it has.
        """
        if front > self.along:
            raise DriveEnded(
                self.reason,
                f"the robot came to its {self.reason} (s = {self.along:.0f} m) after {time:.2f} s; {self.remedy}",
            )
