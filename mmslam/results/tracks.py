"""Tracks in the Python interface: by user, as a table, as a plot."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from estimator.results.estimate import Mirror
from mmslam.moving_users import MovingUser
from mmslam.table import Table, html, text

if TYPE_CHECKING:  # matplotlib's import takes half a second that not everybody needs
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True, repr=False)
class Tracks:
    """The users of successive measurements, with the tracks through their position estimates."""

    users: tuple[MovingUser, ...]
    mirrors: tuple[Mirror, ...]  # of the room, as the last measurement shows it
    aperture: Float[np.ndarray, "positions 3"]  # [m]

    def __getitem__(self, name: str) -> MovingUser:
        """Return a user by name.

        Raises
        ------
        KeyError
            If there is none of this name.
        """
        for user in self.users:
            if user.name == name:
                return user
        raise KeyError(f"no user {name!r}; there are {', '.join(one.name for one in self.users)}")

    def __iter__(self) -> Iterator[MovingUser]:
        """Go through the users."""
        return iter(self.users)

    def __len__(self) -> int:
        """Count the users."""
        return len(self.users)

    def plot(
        self,
        *,
        truths: Sequence[Mapping[str, Float[np.ndarray, " 3"]]] = (),
        ax: "Axes | None" = None,
    ) -> "Axes":
        """Draw the tracks in the plan of the room, with their 95 % ellipses.

        Parameters
        ----------
        truths
            Where users truly are at each time, if that is known. [m]
        ax
            Where to draw; None: on a new figure of pyplot.
        """
        from mmslam.results.plots import new_axes
        from mmslam.results.track_figure import draw_tracks

        return draw_tracks(
            new_axes() if ax is None else ax, self.users, truths, self.mirrors, self.aperture
        )

    def __repr__(self) -> str:
        """Show a line for each time of each user."""
        return text([self._table()])

    def _repr_html_(self) -> str:
        return html([self._table()])

    def _table(self) -> Table:
        rows = []
        for user in self.users:
            for point in user.track.points:
                spread = 1e3 * sqrt(max(float(np.trace(point.covariance[:3, :3])), 0.0))
                place = ", ".join(f"{value:.4f}" for value in point.position)
                basis = "bridged" if point.candidate is None else "located"
                rows.append(
                    (
                        user.name,
                        f"{point.time:.3f}",
                        f"({place})",
                        f"{spread:.2f}",
                        f"{float(np.linalg.norm(point.velocity)):.2f}",
                        f"alternative {point.candidate}" if point.candidate else basis,
                    )
                )
        heads = ("user", "time [s]", "position [m]", "± [mm]", "speed [m/s]", "basis")
        return Table(heads=heads, rows=rows)
