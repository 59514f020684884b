"""A scenario's room for other methods: pilots at additional anchors, in the same realisation.

The room is one frozen realisation of the scenario, that of our own measurement with the same
seed. An anchor is another base station, simulated like ours; every receiver has the noise of our
base station's receiver, whose SNR the scenario states, except in another band: there each receiver
has that SNR itself (:meth:`Room.pilot`).
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.model import Uplink
from scenes.random_streams import random_stream
from scenes.scenario import Scenario
from scenes.schema.base_station import BaseStation
from scenes.schema.radio import Radio
from simulator.antennas.ports import Ports
from simulator.response.uplink import simulate_uplink
from simulator.scene.radio_scene import RadioScene, facet_ports, radio_scene
from validation.analytic.point_scatterer import complex_noise

LEVEL_ELEMENTS = 17
"""Elements of our array, evenly spread, over which the signal level for its noise is averaged: the
error of the mean over 17 independently fading ones is a decibel. [-]"""


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """A receiver at a known position: an array, or a single antenna."""

    x: float  # [m]
    y: float  # [m]
    elements: int = 1
    spacing: float = 0.5e-3  # [m]
    boresight_deg: float = 90.0

    @property
    def position(self) -> Float[np.ndarray, " 2"]:
        """Its centre. [m]."""
        return np.array([self.x, self.y])


ANCHORS = (
    Anchor(x=0.0, y=0.0),
    Anchor(x=0.25, y=0.0),
    Anchor(x=-0.15, y=0.0),
    Anchor(x=0.12, y=-0.25),
)
"""Anchors of methods that need several: ours, and three more in the same room. All of them receive
the hidden user of ``slam_2d`` over its wall only; they are not in a line, which would not
distinguish its two sides. [m]"""


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A method's position of the user, or the reason for none."""

    position: Float[np.ndarray, " 2"] | None  # [m]
    reason: str | None = None


class Baseline(Protocol):
    """A method of locating the user of a room from pilots at known anchors."""

    def __call__(self, room: "Room") -> Fix:
        """Locate the user."""
        ...


class Room:
    """One realisation of a two-dimensional scenario with one user."""

    def __init__(self, scenario: Scenario, *, seed: int) -> None:
        if scenario.dimensions != 2 or len(scenario.users) != 1:
            raise ValueError(
                f"scenario {scenario.name!r} has {scenario.dimensions} dimensions and "
                f"{len(scenario.users)} users; the other methods are for two and one"
            )
        self._scenario, self._seed = scenario, seed
        (self._name,) = scenario.users
        self._scenes: dict[Radio, RadioScene] = {}
        self._pilots: dict[str, Uplink] = {}
        self._ports: dict[tuple[Radio, BaseStation, bytes], Ports] = {}
        places = scenario.base_station.element_positions
        some = np.linspace(0, len(places) - 1, min(LEVEL_ELEMENTS, len(places))).astype(int)
        heard = self._noise_free(scenario, places[some], scenario.users[self._name].position)
        self._power = float(np.mean(np.abs(heard) ** 2))

    @property
    def scenario(self) -> Scenario:
        """The scenario; a method may use its radio and its array, not user or walls."""
        return self._scenario

    @property
    def own_array(self) -> Anchor:
        """Our base station's array."""
        station = self._scenario.base_station
        places = station.element_positions
        x, y, _ = station.centre.tolist()
        reach = float(np.linalg.norm(places[-1] - places[0]))
        return Anchor(
            x=x,
            y=y,
            elements=len(places),
            spacing=round(reach / (len(places) - 1), 9),
            boresight_deg=station.boresight_deg,
        )

    @property
    def radio(self) -> Radio:
        """Our own band."""
        return self._scenario.radio

    def pilot(
        self,
        anchor: Anchor,
        *,
        radio: Radio | None = None,
        survey: Float[np.ndarray, " 2"] | None = None,
        offset: Float[np.ndarray, " 2"] | None = None,
    ) -> Uplink:
        """Return the pilot of the user, or for a survey of the same antenna at a known position.

        Parameters
        ----------
        anchor
            The receiver.
        radio
            Another band, in which the SNR is the scenario's; ``None``: ours, with our noise.
        survey
            Known position of a survey; ``None``: the user itself. [m]
        offset
            From the user's centre to the transmitting antenna of its array. [m]
        """
        where = self._scenario.users[self._name].position if survey is None else _in_plane(survey)
        if offset is not None:
            where = where + _in_plane(offset)
        station = BaseStation(
            elements=anchor.elements,
            spacing_mm=1e3 * anchor.spacing,
            position_m=(anchor.x, anchor.y, 0.0),
            boresight_deg=anchor.boresight_deg,
            antenna=self._scenario.base_station.antenna,
        )
        label = f"{anchor}/{radio}/{survey}/{offset}"
        return self._heard(station, where, radio=radio, label=label)

    def pilot_at_user(
        self, anchor: Anchor, *, elements: int, turn: float, radio: Radio | None = None
    ) -> Uplink:
        """Return the pilot of an anchor at an array of the user, with the same antennas.

        Parameters
        ----------
        anchor
            The transmitter, at its centre.
        elements
            Of the user's array, half a wavelength of our highest frequency apart.
        turn
            Rotation of the array from the user's aim, unknown to the method. [rad]
        radio
            See :meth:`pilot`.
        """
        user = self._scenario.users[self._name]
        looks = self._scenario.aim(user.antenna, user.position)
        if not getattr(user.antenna, "aims", ()):  # an isotropic user faces our base station
            looks = self._scenario.base_station.centre - user.position
        station = BaseStation(
            elements=elements,
            spacing_mm=1e3 * self.radio.shortest_wavelength / 2,
            position_m=tuple(user.position.tolist()),
            boresight_deg=float(np.degrees(np.arctan2(looks[1], looks[0]) + turn)) % 360.0,
            antenna=user.antenna,
        )
        sender = _in_plane(anchor.position)
        label = f"at user/{anchor}/{elements}/{radio}"
        return self._heard(station, sender, radio=radio, label=label, isotropic=True)

    def _heard(
        self,
        station: BaseStation,
        sender: Float[np.ndarray, " 3"],
        *,
        radio: Radio | None,
        label: str,
        isotropic: bool = False,
    ) -> Uplink:
        if label in self._pilots:
            return self._pilots[label]
        update: dict[str, object] = {"base_station": station, "radio": radio or self.radio}
        scenario = self._scenario.model_copy(update=update)
        samples = self._noise_free(scenario, station.element_positions, sender, isotropic=isotropic)
        power = self._power if radio is None else float(np.mean(np.abs(samples) ** 2))
        rng = random_stream(self._seed, 0, f"noise/baseline/{label}")
        noise = complex_noise(samples.shape, power / 10 ** (self._scenario.noise.snr_db / 10), rng)
        heard = self._pilots[label] = Uplink(
            samples=samples + noise,
            positions=station.element_positions,
            frequencies=scenario.radio.frequencies,
            user=self._name,
        )
        return heard

    def _noise_free(
        self,
        scenario: Scenario,
        elements: Float[np.ndarray, "elements 3"],
        sender: Float[np.ndarray, " 3"],
        *,
        isotropic: bool = False,
    ) -> Complex[np.ndarray, "elements freqs"]:
        if scenario.radio not in self._scenes:
            own = self._scenario.model_copy(update={"radio": scenario.radio})
            self._scenes[scenario.radio] = radio_scene(own, seed=self._seed, sample=0)
        scene = replace(self._scenes[scenario.radio], scenario=scenario, elements=elements)
        user = scenario.users[self._name]
        place: dict[str, object] = {"position_m": tuple(sender.tolist())}
        if isotropic:
            place["antenna"] = self._scenario.base_station.antenna
        key = (scenario.radio, scenario.base_station, elements.tobytes())
        if key not in self._ports and scene.facets is not None:
            antenna = scenario.base_station.antenna
            self._ports[key] = facet_ports(scene, scene.facets, antenna, elements)
        array = self._ports.get(key)
        return simulate_uplink(scene, user.model_copy(update=place), array, advance=lambda: None)


def _in_plane(place: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 3"]:
    return np.array([place[0], place[1], 0.0])
