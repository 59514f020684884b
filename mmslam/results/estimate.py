"""The estimate of the Python interface: the estimator's results, with tables and plots.

Each class here is one of :mod:`estimator.results.estimate` with a short table for a terminal, a
small figure and table for a notebook, and plots. The numbers are the same objects.
"""

import base64
import io
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import degrees, sqrt
from typing import TYPE_CHECKING, Any, SupportsIndex, TypeVar, overload

from estimator.measurement import model
from estimator.results import estimate as plain
from mmslam.plain_text import drawn_plainly
from mmslam.results.estimate_tables import mirrors_table, point, targets_table
from mmslam.table import Table, html, text
from validation.metrics.truth import Truth

if TYPE_CHECKING:  # matplotlib's import takes half a second that not everybody needs
    from matplotlib.axes import Axes

_FIGURE = (5.6, 3.6)  # of a notebook's small figure [inch]
_DOTS_PER_INCH = 90

_T = TypeVar("_T")


class _Shown(ABC):
    """Base of results that print as tables, and in a notebook also as a small figure."""

    @abstractmethod
    def tables(self) -> list[Table]:
        """Return what is shown."""

    def __repr__(self) -> str:
        return text(self.tables())

    def _repr_html_(self) -> str:
        return html(self.tables(), picture=self._picture())

    def _picture(self) -> str:
        return ""


@dataclass(frozen=True, kw_only=True, repr=False)
class User(_Shown, plain.UserEstimate):
    """Estimated position of one user, or the reason why there is none."""

    @property
    def uncertainty_m(self) -> float | None:
        """Standard deviation of the position: root of its covariance's trace. [m]."""
        if self.covariance is None:
            return None
        return sqrt(max(float(self.covariance.trace()), 0.0))

    def plot(self, *, truth: Truth | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the position with its error ellipses, about the truth if that is known."""
        from mmslam.results.plots import plot_user

        return plot_user(self, truth=truth, ax=ax)

    def tables(self) -> list[Table]:
        """Return the position, and the paths from which it was estimated."""
        waves = [
            (
                f"{degrees(path.aoa):.3f}°",
                f"{path.path_length:.4f} m",
                f"{100 * path.share:.1f} %",
                "used" if path.used else path.reason or "not used",
            )
            for path in self.paths
        ]
        heads = ("angle of arrival", "length", "energy", "")
        return [_users_table([self]), Table(heads=heads, rows=waves)]

    def _picture(self) -> str:
        return "" if self.position is None else _png(self.plot)


@dataclass(frozen=True, kw_only=True, repr=False)
class Mirror(_Shown, plain.Mirror):
    """A flat wall of finite extent, at its true (unfolded) place."""

    def tables(self) -> list[Table]:
        """Return its ends and their uncertainty."""
        return [mirrors_table([self])]


@dataclass(frozen=True, kw_only=True, repr=False)
class Target(_Shown, plain.Target):
    """An object that is no mirror."""

    def tables(self) -> list[Table]:
        """Return its position, and its apparent position in the raw image."""
        return [targets_table([self])]


@dataclass(frozen=True, kw_only=True, repr=False)
class Image(_Shown, plain.Image):
    """A complex SAR image on its grid; an ideal unit point target peaks at 1."""

    def plot(self, *, ax: "Axes | None" = None, floor_db: float = -40.0) -> "Axes":
        """Draw its magnitude in decibels below the peak; of a volume, from above."""
        from mmslam.results.plots import plot_image

        return plot_image(self, ax=ax, floor_db=floor_db)

    def tables(self) -> list[Table]:
        """Return its grid."""
        grid = self.grid
        axes = {"x": grid.x, "y": grid.y, "z": grid.z}
        rows = [
            (name, str(axis.size), f"{axis[0]:.4g} m", f"{axis[-1]:.4g} m")
            for name, axis in axes.items()
        ]
        return [Table(title="image", heads=("axis", "pixels", "from", "to"), rows=rows)]

    def _picture(self) -> str:
        return _png(self.plot)


@dataclass(frozen=True, kw_only=True, repr=False)
class CorrectedImage(Image, plain.CorrectedImage):
    """The image with ghosts unfolded: each pixel has the raw image's value at its mirror image."""


@dataclass(frozen=True, kw_only=True, repr=False)
class AngleRangeMap(_Shown, plain.AngleRangeMap):
    """The spherical-wave matched filter of one user's pilot over angle and path length."""

    def plot(self, *, user: plain.UserEstimate | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw it in decibels below its peak, and mark the user's paths."""
        from mmslam.results.plots import plot_angle_range_map

        return plot_angle_range_map(self, user=user, ax=ax)

    def tables(self) -> list[Table]:
        """Return its ranges of angle and path length."""
        angles, lengths = self.aoa, self.path_length
        rows = [
            ("angle", str(angles.size), *(f"{degrees(angles[end]):.2f}°" for end in (0, -1))),
            ("path length", str(lengths.size), *(f"{lengths[end]:.4g} m" for end in (0, -1))),
        ]
        heads = ("axis", "points", "from", "to")
        return [Table(title=f"angle/range map of {self.user}", heads=heads, rows=rows)]

    def _picture(self) -> str:
        return _png(self.plot)


class Users(tuple[User, ...]):
    """The users in the order of the measurement, also by name: ``estimate.users["ann"]``.

    As a tuple it iterates over users; :meth:`keys`, :meth:`values` and :meth:`items` are those of a
    mapping from names to users, so that ``dict(estimate.users)`` is that mapping.

    Examples
    --------
    >>> users = Users([User(name="ann", status="not_found")])
    >>> "ann" in users, list(users.keys()), [user.status for name, user in users.items()]
    (True, ['ann'], ['not_found'])
    """

    @overload
    def __getitem__(self, key: SupportsIndex | str, /) -> User: ...

    @overload
    def __getitem__(self, key: slice, /) -> tuple[User, ...]: ...

    def __getitem__(self, key: SupportsIndex | slice | str, /) -> User | tuple[User, ...]:
        """Return a user by name or number.

        Raises
        ------
        KeyError
            If there is none of this name.
        """
        if not isinstance(key, str):
            return super().__getitem__(key)
        for user in self:
            if user.name == key:
                return user
        raise KeyError(f"no user {key!r}; there are {', '.join(self.names) or 'none'}")

    def __contains__(self, key: object, /) -> bool:
        """Return whether there is a user of this name, or this user."""
        return key in self.names if isinstance(key, str) else any(user is key for user in self)

    @property
    def names(self) -> tuple[str, ...]:
        """The users' names."""
        return tuple(user.name for user in self)

    def keys(self) -> tuple[str, ...]:
        """Return the users' names, in order."""
        return self.names

    def values(self) -> tuple[User, ...]:
        """Return the users, in order."""
        return tuple(self)

    def items(self) -> tuple[tuple[str, User], ...]:
        """Return pairs of name and user, in order."""
        return tuple((user.name, user) for user in self)

    def __repr__(self) -> str:
        """Show them as a table."""
        return text([_users_table(self)])

    def _repr_html_(self) -> str:
        return html([_users_table(self)])


@dataclass(frozen=True, kw_only=True, repr=False)
class Estimate(_Shown, plain.Estimate):
    """All that was estimated from one measurement; it does not contain the truth.

    Examples
    --------
    >>> import numpy as np
    >>> where = np.array([1.0, 0.8, 0.0])
    >>> ann = User(name="ann", status="found", position=where, covariance=1e-8 * np.eye(3))
    >>> estimate = Estimate(users=Users([ann]), mirrors=())
    >>> estimate
    user  status  position [m]      ± [mm]  over    why
    ann   found   (1.0000, 0.8000)  0.173   direct
    no mirror found
    >>> round(1e3 * estimate.users["ann"].uncertainty_m, 3)
    0.173
    """

    users: Users
    mirrors: tuple[Mirror, ...]
    targets: tuple[Target, ...] = ()
    maps: tuple[AngleRangeMap, ...] = ()
    measurement: model.Measurement | None = None  # what it was made from

    @classmethod
    def of(cls, estimate: plain.Estimate, measurement: model.Measurement) -> "Estimate":
        """Convert the estimator's result for a measurement to these classes."""
        parts = _fields(plain.Estimate, estimate)
        parts |= {
            "users": Users(_user(user) for user in estimate.users),
            "mirrors": tuple(_as(Mirror, one) for one in estimate.mirrors),
            "targets": tuple(_as(Target, one) for one in estimate.targets),
            "maps": tuple(_as(AngleRangeMap, one) for one in estimate.maps),
            "aperture": measurement.places,
        }
        return cls(**parts, measurement=measurement)

    @cached_property
    def raw_image(self) -> Image | None:
        """The image as measured, formed when first asked for; None without an echo."""
        return _as(Image, self.images.value.raw)

    @cached_property
    def corrected_image(self) -> CorrectedImage | None:
        """The image with ghosts unfolded, formed with the raw one; None without an echo."""
        return _as(CorrectedImage, self.images.value.corrected)

    @cached_property
    def close_ups(self) -> tuple[AngleRangeMap, ...]:
        """Angle/range maps enlarged around each user's estimate or peak; made on first access."""
        return tuple(_as(AngleRangeMap, one) for one in self.close_up_maps.value)

    def plot(self, *, truth: Truth | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the plan of what was found: array, mirrors, targets, paths and users.

        Parameters
        ----------
        truth
            What is drawn beside it: grey walls, and rings where users really are.
        ax
            Where to draw; None: on a new figure of pyplot.

        Returns
        -------
        The axes, in metres.
        """
        from mmslam.results.plots import plot_estimate

        return plot_estimate(self, truth=truth, ax=ax)

    def to_dict(self, *, truth: Truth | None = None) -> Mapping[str, Any]:
        """Return the document of ``result.json``; with the truth, errors are in it.

        Raises
        ------
        ValueError
            If the estimate holds no measurement.
        """
        from mmslam.results.document import result_document

        if self.measurement is None:
            raise ValueError(
                "this estimate does not know its measurement; use one that mmslam.locate returned"
            )
        return result_document(self.measurement, self, truth or Truth())

    def tables(self) -> list[Table]:
        """Return users, mirrors, targets and notes."""
        notes = Table(rows=[(f"note: {note}",) for note in self.notes])
        none = Table(rows=[("no mirror found",)])
        found = [mirrors_table(self.mirrors) if self.mirrors else none]
        found += [targets_table(self.targets)] if self.targets else []
        return [_users_table(self.users), *found, notes]

    def _picture(self) -> str:
        return "" if self.aperture is None else _png(self.plot)


def _fields(kind: type, one: object) -> dict[str, Any]:
    return {field.name: getattr(one, field.name) for field in fields(kind)}


@overload
def _as(kind: type[_T], one: None) -> None: ...


@overload
def _as(kind: type[_T], one: object) -> _T: ...


def _as(kind: type[_T], one: object | None) -> _T | None:
    """Make one of our classes of the estimator's."""
    return None if one is None else kind(**_fields(type(one), one))


def _user(user: plain.UserEstimate) -> User:
    others = tuple(_user(other) for other in user.alternatives)
    return User(**{**_fields(plain.UserEstimate, user), "alternatives": others})


def _users_table(users: Sequence[User]) -> Table:
    rows = []
    for user in users:
        spread = user.uncertainty_m
        rows.append(
            (
                user.name,
                user.status.replace("_", " "),
                "" if user.position is None else point(user.position),
                "" if spread is None else f"{1e3 * spread:.3f}",
                _over(user),
                user.reason or "",
            )
        )
    heads = ("user", "status", "position [m]", "± [mm]", "over", "why")
    return Table(heads=heads, rows=rows)


def _over(user: plain.UserEstimate) -> str:
    if user.position is None:
        return ""
    if user.bounces:
        return f"{user.bounces} mirror{'' if user.bounces == 1 else 's'}"
    return "direct" if user.method == "paths" else "diffuse"


def _png(plot: Any) -> str:
    """Draw on a new figure outside pyplot, and return it as a PNG in base64."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_FIGURE, layout="constrained")
    plot(ax=figure.add_subplot())
    drawn = io.BytesIO()
    drawn_plainly(figure)
    figure.savefig(drawn, dpi=_DOTS_PER_INCH, format="png", metadata={"Software": None})
    return base64.b64encode(drawn.getvalue()).decode("ascii")
