"""Where a drive ends because its road does."""

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
