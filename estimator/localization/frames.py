"""Between the world's frame, in which is measured and answered, and the array's."""

from dataclasses import replace

from estimator.array.array_frame import ArrayFrame
from estimator.measurement.model import Echo, Uplink
from estimator.results.estimate import UserEstimate


def local_echo(echo: Echo, frame: ArrayFrame) -> Echo:
    """Return an echo with its positions in the array's frame."""
    apart = echo.transmit_positions
    return replace(
        echo,
        positions=frame.to_local(echo.positions),
        transmit_positions=None if apart is None else frame.to_local(apart),
    )


def local_uplink(uplink: Uplink, frame: ArrayFrame) -> Uplink:
    """Return a pilot with its positions in the array's frame."""
    return replace(uplink, positions=frame.to_local(uplink.positions))


def user_in_world(user: UserEstimate, frame: ArrayFrame) -> UserEstimate:
    """Return a user's place, its covariance and its path in the world's frame."""
    if user.position is None or user.covariance is None or user.path is None:
        return user
    return replace(
        user,
        position=frame.to_world(user.position),
        covariance=frame.axes.T @ user.covariance @ frame.axes,
        path=frame.to_world(user.path),
        alternatives=tuple(user_in_world(other, frame) for other in user.alternatives),
    )
