"""The prior distribution of random rooms, and rooms drawn from it.

A room of the set ``plain`` has a linear array of 128 elements of 0.5 mm and 501 points over 220 to
295 GHz (unambiguous to 1 m of echo, 2 m of path); one to three plates of metal, drywall or glass,
8 to 30 cm long, their centres at x = −0.35 to 0.35 and y = 0.25 to 0.6 m, at any angle, each with
Gaussian heights of 0.02 to 0.15 mm rms and 0.4 to 2 mm correlation length; none to two metal posts
of 3 to 12 mm radius; a user at x = −0.5 to 0.5, y = 0.1 to 0.8 m, with an isotropic antenna in half
of the rooms and a Gaussian beam of 0.08 to 0.5 rad aimed at one of the plates in the others; an SNR
of 0 to 30 dB; and up to one bounce, in a fifth of the rooms two. All are uniform and independent.
Impossible rooms (bodies that intersect, a user in a body) are drawn again.

The other sets differ from it:

``bodies``
    One or two more objects: boxes of metal, chipboard or cardboard, 6 to 15 cm by 4 to 10 cm, or
    absorbing screens of 8 to 25 cm, in the same region as the plates.
``bounces``
    Up to two bounces in half of the rooms, three in the other half.
``bands``
    The band's lower end is log-uniform from 24 to 300 GHz (upper end at most 330 GHz), its width 12
    to 30 % of it; 16 to 300 elements, 0.43 shortest wavelengths apart. If the aperture is wider
    than that of ``plain``, lengths are scaled with it, up to five times; heights are scaled with
    the wavelength. Plates are of metal or drywall: the permittivity of glass is not known at all
    bands.
``space``
    In three dimensions: 16 x 16 elements 2.4 mm apart, 57 to 64 GHz in 81 points (unambiguous to
    1.7 m of echo), in a fifth of the rooms in 41 (0.86 m, nearer than most walls); one or two
    upright plates of metal, 0.3 to 0.6 m wide and 0.3 to 0.5 m high, 0.7 to 1.2 m away within 0.4 m
    of boresight, 0.1 to 0.4 mm rms, 2 to 6 mm; a user 0.3 to 1.4 m away and up to 0.7 m aside.
"""

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from scipy.constants import speed_of_light

from scenes.random_streams import random_stream
from scenes.scenario import Scenario, ScenarioError, parse_scenario

Purpose = Literal["tuning", "judging"]
Tables = dict[str, object]

SEEDS: Mapping[Purpose, int] = {"tuning": 1801, "judging": 5417}
"""Seeds of the rooms, their surfaces and noise, different for both purposes."""

MOST_TRIES = 1000
"""Most draws of one room: about half of the draws are possible. [-]"""

USER = "user"
"""Name of the only user."""

_PLAIN_APERTURE = 127 * 0.5e-3  # [m]
_PLAIN_WAVELENGTH = 2 * speed_of_light / (220e9 + 295e9)  # [m]
_MOST_GROWN = 5.0


def draw_room(kind: str, number: int, *, purpose: Purpose) -> Scenario:
    """Draw a room, which depends on the three arguments alone.

    Parameters
    ----------
    kind
        The set: a key of :data:`SETS`.
    number
        Of the room in its set, from 0.
    purpose
        Rooms to tune on, or to judge by.

    Raises
    ------
    ValueError
        If there is no such set.
    """
    if kind not in SETS:
        raise ValueError(f"no set of rooms {kind!r}; there are {', '.join(SETS)}")
    rng = random_stream(SEEDS[purpose], number, f"room/{kind}")
    for _ in range(MOST_TRIES):
        tables = SETS[kind](rng)
        tables["name"] = f"{kind}_{purpose}_{number}"
        tables["title"] = "A room drawn at random"
        try:
            return parse_scenario(tables)
        except ScenarioError:
            continue
    raise AssertionError(f"{kind} {number}: no possible room in {MOST_TRIES} draws")


def _plain(rng: np.random.Generator) -> Tables:
    return _flat_room(
        rng,
        radio={"start_ghz": 220.0, "stop_ghz": 295.0, "points": 501},
        station={"elements": 128, "spacing_mm": 0.5},
        bounces=2 if rng.random() < 0.2 else 1,
    )


def _bounces(rng: np.random.Generator) -> Tables:
    return {**_plain(rng), "max_bounces": int(rng.integers(2, 4))}


def _bodies(rng: np.random.Generator) -> Tables:
    room = _plain(rng)
    objects = room["objects"]
    assert isinstance(objects, dict)
    for index in range(int(rng.integers(1, 3))):
        body: Tables = {"centre_m": _centre(rng), "angle_deg": _rounded(rng, 0.0, 180.0, 3)}
        if rng.random() < 0.5:
            body |= {
                "kind": "box",
                "material": str(rng.choice(["metal", "chipboard", "cardboard"])),
                "length_m": _rounded(rng, 0.06, 0.15, 4),
                "depth_m": _rounded(rng, 0.04, 0.10, 4),
                "roughness": _roughness(rng),
            }
        else:
            body |= {
                "kind": "plate",
                "material": "absorber",
                "length_m": _rounded(rng, 0.08, 0.25, 4),
            }
        objects[f"body{index}"] = body
    return room


def _bands(rng: np.random.Generator) -> Tables:
    start = 24e9 * (300 / 24) ** rng.random()
    stop = min(start * rng.uniform(1.12, 1.30), 330e9)
    elements = int(rng.integers(16, 301))
    spacing = 0.43 * speed_of_light / stop
    size = float(np.clip((elements - 1) * spacing / _PLAIN_APERTURE, 1.0, _MOST_GROWN))
    points = round((stop - start) / (speed_of_light / (2 * size))) + 1
    return _flat_room(
        rng,
        radio={
            "start_ghz": round(start / 1e9, 3),
            "stop_ghz": round(stop / 1e9, 3),
            "points": points,
        },
        station={"elements": elements, "spacing_mm": round(1e3 * spacing, 4)},
        bounces=1,
        materials=("metal", "drywall"),
        size=size,
        height=2 * speed_of_light / (start + stop) / _PLAIN_WAVELENGTH,
    )


def _flat_room(
    rng: np.random.Generator,
    *,
    radio: Tables,
    station: Tables,
    bounces: int,
    materials: tuple[str, ...] = ("metal", "drywall", "glass"),
    size: float = 1.0,
    height: float = 1.0,
) -> Tables:
    objects: Tables = {}
    plates = [f"wall{index}" for index in range(int(rng.integers(1, 4)))]
    for name in plates:
        objects[name] = {
            "kind": "plate",
            "material": str(rng.choice(materials)),
            "centre_m": _centre(rng, size),
            "angle_deg": _rounded(rng, 0.0, 180.0, 3),
            "length_m": round(size * rng.uniform(0.08, 0.30), 4),
            "roughness": _roughness(rng, height),
        }
    for index in range(int(rng.integers(0, 3))):
        objects[f"post{index}"] = {
            "kind": "cylinder",
            "material": "metal",
            "centre_m": _centre(rng, size),
            "radius_m": round(size * rng.uniform(0.003, 0.012), 4),
        }
    user: Tables = {"position_m": _place(rng, (-0.5, 0.1), (0.5, 0.8), size)}
    user |= _antenna(rng, plates, narrowest=0.08)
    return {
        "dimensions": 2,
        "max_bounces": bounces,
        "radio": radio,
        "base_station": station,
        "objects": objects,
        "users": {USER: user},
        "noise": {"snr_db": _rounded(rng, 0.0, 30.0, 1)},
    }


def _space(rng: np.random.Generator) -> Tables:
    plates = [f"wall{index}" for index in range(int(rng.integers(1, 3)))]
    objects: Tables = {}
    for name in plates:
        objects[name] = {
            "kind": "plate",
            "material": "metal",
            "centre_m": [_rounded(rng, -0.4, 0.4, 4), _rounded(rng, 0.7, 1.2, 4), 0.0],
            "angle_deg": _rounded(rng, -50.0, 50.0, 3),
            "length_m": _rounded(rng, 0.3, 0.6, 4),
            "height_m": _rounded(rng, 0.3, 0.5, 4),
            "roughness": {
                "rms_mm": _rounded(rng, 0.1, 0.4, 3),
                "correlation_mm": _rounded(rng, 2.0, 6.0, 3),
            },
        }
    user: Tables = {
        "position_m": [
            _rounded(rng, -0.7, 0.7, 4),
            _rounded(rng, 0.3, 1.4, 4),
            _rounded(rng, -0.1, 0.1, 4),
        ]
    }
    user |= _antenna(rng, plates, narrowest=0.15)
    points = 41 if rng.random() < 0.2 else 81
    return {
        "dimensions": 3,
        "max_bounces": 1,
        "radio": {"start_ghz": 57.0, "stop_ghz": 64.0, "points": points},
        "base_station": {"elements": [16, 16], "spacing_mm": 2.4},
        "objects": objects,
        "users": {USER: user},
        "noise": {"snr_db": _rounded(rng, 0.0, 30.0, 1)},
    }


def _antenna(rng: np.random.Generator, plates: list[str], *, narrowest: float) -> Tables:
    """Draw a beam of at least some width [rad] aimed at a wall, or an isotropic antenna."""
    if rng.random() >= 0.5:
        return {}
    beam = {
        "kind": "gaussian_beam",
        "sigma_rad": _rounded(rng, narrowest, 0.5, 3),
        "aim": str(rng.choice(plates)),
    }
    return {"antenna": beam}


def _centre(rng: np.random.Generator, size: float = 1.0) -> list[float]:
    return _place(rng, (-0.35, 0.25), (0.35, 0.6), size)


def _place(
    rng: np.random.Generator, low: tuple[float, float], high: tuple[float, float], size: float
) -> list[float]:
    """Draw a position in a box that is scaled about the array. [m]."""
    return [round(size * float(value), 4) for value in rng.uniform(low, high)]


def _roughness(rng: np.random.Generator, height: float = 1.0) -> Tables:
    return {
        "rms_mm": round(height * rng.uniform(0.02, 0.15), 4),
        "correlation_mm": round(height * rng.uniform(0.4, 2.0), 4),
        "spectrum": "gaussian",
    }


def _rounded(rng: np.random.Generator, low: float, high: float, digits: int) -> float:
    """Draw a number of few digits, so that writing the room to a file is lossless."""
    return round(float(rng.uniform(low, high)), digits)


SETS: Mapping[str, Callable[[np.random.Generator], Tables]] = {
    "plain": _plain,
    "bodies": _bodies,
    "bounces": _bounces,
    "bands": _bands,
    "space": _space,
}
"""Function that draws a room of each set."""
