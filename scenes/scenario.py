"""Scenarios: typed and checked models of a scene, the ground truth of a simulation.

Keys carry their units (GHz, mm, m, degree, dB); the properties are SI and radians.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from scenes.checks.dimensions import dimension_problems
from scenes.checks.facet_budget import facet_problems
from scenes.checks.files import file_problems
from scenes.checks.multistatic import multistatic_problems
from scenes.checks.placement import inconsistencies
from scenes.checks.points import point_problems
from scenes.meshes.foreign_scene import with_geometry
from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.air import Air
from scenes.schema.antenna import Antenna, Cosine, Directive, GaussianBeam, Horn, Isotropic
from scenes.schema.base_station import BaseStation
from scenes.schema.directions import unit_vector
from scenes.schema.effects import Effects
from scenes.schema.errors import ScenarioError, did_you_mean, problems
from scenes.schema.impairments import Impairments
from scenes.schema.materials import MATERIALS, Slab
from scenes.schema.multistatic import Arc, Places, Transmitter
from scenes.schema.noise import Noise
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate, SceneObject
from scenes.schema.point_target import PointTarget
from scenes.schema.quantities import Checked, Name
from scenes.schema.radio import Radio
from scenes.schema.roughness import Roughness
from scenes.schema.user import User
from scenes.surfaces.facet_spacing import facet_spacing

__all__ = [
    "MATERIALS",
    "Air",
    "Antenna",
    "Arc",
    "BaseStation",
    "Box",
    "Cosine",
    "Cylinder",
    "Directive",
    "Effects",
    "GaussianBeam",
    "Horn",
    "Impairments",
    "Isotropic",
    "MeshFile",
    "Noise",
    "Places",
    "Plate",
    "PointTarget",
    "Radio",
    "Roughness",
    "Scenario",
    "ScenarioError",
    "SceneObject",
    "Slab",
    "Transmitter",
    "User",
    "parse_scenario",
]

MOST_SAMPLES = 2**30
"""Most samples of an echo or an uplink: 16 GiB of complex doubles."""


class Scenario(Checked):
    """A whole scene: radio, base station, objects, users and noise. The truth.

    Examples
    --------
    >>> from scenes import load_scenario
    >>> room = load_scenario("slam_2d")
    >>> room.dimensions, list(room.objects), room.radio.points
    (2, ['wall'], 1001)
    """

    format: Literal[1] = Field(1, description="the format of this file: 1")
    name: Name = Field(description="the scenario's name")
    title: str = Field("", max_length=200, description="what it shows, in a line")
    dimensions: Literal[2, 3] = Field(2, description="2 (invariant along z) or 3")
    waves: Literal["spherical", "cylindrical"] = Field(
        "spherical", description="'spherical', or 'cylindrical' (2-D full wave)"
    )
    max_bounces: int = Field(
        3,
        ge=0,
        le=8,
        description=(
            "the most surfaces that a wave meets between two antennas (0: the line of sight, and "
            "no echo of surfaces)"
        ),
    )
    radio: Radio = Field(description="the table [radio]")
    base_station: BaseStation = Field(description="the table [base_station]")
    objects: dict[Name, SceneObject] = Field(default_factory=dict, description="objects by name")
    points: dict[Name, PointTarget] = Field(
        default_factory=dict, description="ideal point targets by name"
    )
    users: dict[Name, User] = Field(default_factory=dict, description="users by name")
    effects: Effects = Field(default_factory=Effects, description="the table [effects]")
    noise: Noise = Field(default_factory=Noise, description="the table [noise]")
    air: Air | None = Field(
        None, description="the table [air]: what waves run in; without it, vacuum"
    )
    impairments: Impairments = Field(
        default_factory=Impairments, description="the table [impairments]"
    )

    @model_validator(mode="after")
    def _possible(self) -> "Scenario":
        # In this order: each check relies on those before it.
        found = [
            *dimension_problems(
                dimensions=self.dimensions,
                waves=self.waves,
                max_bounces=self.max_bounces,
                radio=self.radio,
                station=self.base_station,
                users=self.users,
                points=self.points,
                objects=self.objects,
            ),
            *_sample_problems(self),
        ]
        found = found or file_problems(
            self.objects, self.radio.frequencies, flat=self.dimensions == 2
        )
        found = found or [
            *_aim_problems(self),
            *point_problems(
                self.points,
                waves=self.waves,
                station=self.base_station,
                users=self.users,
                clearance=self.radio.longest_wavelength,
            ),
            *facet_problems(
                self.objects,
                self.radio.shortest_wavelength,
                flat=self.dimensions == 2,
                mirrors_longer_than=self.radio.longest_wavelength
                if self.dimensions == 3 and not self.base_station.multistatic
                else None,
            ),
            *inconsistencies(
                self.objects,
                array=None
                if self.base_station.receivers is not None
                else self.base_station.element_positions.reshape(*self.base_station.shape, 3),
                users={name: user.position for name, user in self.users.items()},
                clearance=self.radio.longest_wavelength,
            ),
            *multistatic_problems(
                self.base_station,
                self.objects,
                users=tuple(self.users),
                clearance=self.radio.longest_wavelength,
            ),
        ]
        offset = self.base_station.transmit_offset
        if not found and offset is not None and self.base_station.receivers is None:
            senders = self.base_station.element_positions + offset
            found = inconsistencies(
                self.objects,
                array=senders.reshape(*self.base_station.shape, 3),
                users={name: user.position for name, user in self.users.items()},
                clearance=self.radio.longest_wavelength,
            )
        if found:
            raise PydanticCustomError("inconsistent", "inconsistent", {"problems": found})
        return self

    def facet_spacing(self, name: str) -> float:
        """Return the largest facet spacing that an object needs.

        See :mod:`scenes.surfaces.facet_spacing`. Infinity for an absorber: it scatters nothing. [m]
        """
        return facet_spacing(self.objects[name], self.radio.shortest_wavelength)

    def aim(self, antenna: Antenna, position: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        """Return the unit vector of the boresight of an antenna at that position.

        An antenna without an aim (isotropic, or the base station's) looks along the base
        station's boresight.

        Raises
        ------
        ScenarioError
            If the aim is where the antenna stands.
        """
        if not isinstance(antenna, Directive) or not antenna.aims:
            return self.base_station.boresight
        if antenna.aim_deg is not None:
            return unit_vector(antenna.aim_deg)
        if antenna.aim is not None:
            target = self.object_centre(antenna.aim)
        else:
            target = np.asarray(antenna.aim_m, dtype=np.float64)
        offset = target - position
        distance = float(np.linalg.norm(offset))
        if distance == 0.0:
            raise ScenarioError(
                f"aim {target.tolist()} m is where the antenna stands; aim it at another point"
            )
        direction: np.ndarray = offset / distance
        return direction

    def element_aims(
        self, positions: Float[np.ndarray, "elements 3"]
    ) -> Float[np.ndarray, "elements 3"]:
        """Return the unit vectors in which the base station's receiving antennas look.

        The elements of an array look in parallel; receivers that stand by themselves look at
        the antenna's aim each for itself.

        Parameters
        ----------
        positions
            Where they stand. [m]
        """
        antenna = self.base_station.antenna
        if self.base_station.receivers is None:
            return np.tile(self.aim(antenna, positions.mean(axis=0)), (len(positions), 1))
        return np.array([self.aim(antenna, place) for place in positions])

    def transmit_aims(
        self, positions: Float[np.ndarray, "elements 3"]
    ) -> Float[np.ndarray, "elements 3"]:
        """Return the unit vectors in which the transmitters of the echo look.

        Parameters
        ----------
        positions
            Where they stand, one for each element. A transmitter that stands by itself looks
            at its antenna's aim; those beside an array's elements look in parallel. [m]
        """
        station = self.base_station
        if not station.multistatic:
            return np.tile(self.aim(station.antenna, positions.mean(axis=0)), (len(positions), 1))
        return np.array([self.aim(station.transmit_antenna, place) for place in positions])

    def object_centre(self, name: str) -> Float[np.ndarray, " 3"]:
        """Return the centre of an object; of a mesh, that of its bounding box [m]."""
        body = self.objects[name]
        if isinstance(body, MeshFile):
            centre: np.ndarray = placed_mesh(body).bounds.mean(axis=0)
            return centre
        return body.centre


def parse_scenario(data: Mapping[str, object]) -> Scenario:
    """Read a scenario from nested tables, as a TOML file holds them.

    Parameters
    ----------
    data
        The tables; see :class:`Scenario`, and :class:`scenes.meshes.foreign_scene.Geometry` for the
        table ``geometry``, which brings in a foreign scene.

    Raises
    ------
    ScenarioError
        If something is missing, unknown or impossible: a line for each problem.
    """
    try:
        return Scenario.model_validate(with_geometry(data))
    except ValidationError as error:
        raise ScenarioError("\n".join(problems(error, Scenario))) from None


def _aim_problems(scenario: Scenario) -> list[str]:
    found = []
    station = scenario.base_station
    places = station.element_positions if station.receivers is not None else station.centre[None]
    antennas = [("base_station.antenna", station.antenna, places)]
    if station.transmitter is not None and station.transmitter.antenna is not None:
        places = station.transmitter.positions
        antennas.append(("base_station.transmitter.antenna", station.transmitter.antenna, places))
    antennas += [
        (f"users.{name}.antenna", user.antenna, user.position[None])
        for name, user in scenario.users.items()
    ]
    for key, antenna, places in antennas:
        if not isinstance(antenna, Directive):
            continue
        if antenna.aim is not None and antenna.aim not in scenario.objects:
            known = ", ".join(scenario.objects) or "none"
            found.append(
                f"{key}.aim = {antenna.aim!r}: no such object"
                f"{did_you_mean(antenna.aim, scenario.objects)}; known: {known}"
            )
            continue
        try:
            for place in places:
                scenario.aim(antenna, place)
        except ScenarioError as error:
            found.append(f"{key}: {error}")
    return found


def _sample_problems(scenario: Scenario) -> list[str]:
    samples = scenario.base_station.element_count * scenario.radio.points
    if samples <= MOST_SAMPLES:
        return []
    return [
        f"radio.points = {scenario.radio.points}: {scenario.base_station.element_count} elements "
        f"times that are {samples:.3g} samples, more than {MOST_SAMPLES:.3g}; reduce radio.points "
        "or base_station.elements"
    ]
