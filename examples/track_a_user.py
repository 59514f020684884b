"""Follow a user that moves, without line of sight: simulate, locate at each time, track, draw.

Run as ``python examples/track_a_user.py [FOLDER]``; it writes ``track.zarr`` (a dataset whose
samples are times) and ``track.png``. It takes about 15 s on two idle cores.

The room is that of ``slam_2d``, smaller. The user walks past its wall at 0.7 m/s and sends a pilot
every 50 ms, all of which a single simulation gives: each time is a user of its own there. At one
time nothing is sent; the track bridges it.
"""

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import mmslam
from scenes.scenario import parse_scenario

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
STEP = 0.05  # [s]
SILENT = 3  # the time without a pilot
places = np.stack([np.linspace(0.40, 0.60, 7), np.linspace(0.36, 0.44, 7)], axis=1)  # [m]

scenario = mmslam.load_scenario(
    "slam_2d",
    {
        "base_station.elements": 96,
        "radio.points": 401,
        "objects.wall.centre_m": [0.0, 0.4],
        "objects.wall.length_m": 0.25,
    },
)
tables = scenario.model_dump(mode="json", exclude_none=True)
antenna = tables["users"].pop("user")["antenna"]
for index, place in enumerate(places):
    if index != SILENT:
        tables["users"][f"{index}"] = {"position_m": place.tolist(), "antenna": antenna}
measurement = mmslam.simulate(parse_scenario(tables), seed=0)

# One sample for each time: the echo of the room, and the pilot of that time, of user "ann".
rng = np.random.default_rng(0)
quiet = 1e-6 * (rng.standard_normal((2, *measurement.uplinks[0].samples.shape)))
pilots = {uplink.user: uplink for uplink in measurement.uplinks}
samples = []
for index in range(len(places)):
    pilot = pilots.get(
        f"{index}", replace(measurement.uplinks[0], samples=quiet[0] + 1j * quiet[1])
    )
    samples.append(
        replace(measurement, uplinks=(replace(pilot, user="ann"),), clock_offset=0.0).to_xarray()
    )
dataset = xr.concat(samples, "sample", data_vars=["echo", "uplink"], join="exact")
times = STEP * np.arange(len(places))
dataset["time"] = ("sample", times, {"units": "s"})
dataset.to_zarr(folder / "track.zarr", mode="w", zarr_format=3, consolidated=False)

(ann,) = mmslam.track(folder / "track.zarr")
for time, answer in zip(ann.times, ann.answers, strict=True):
    print(f"{time:.2f} s: {answer.status}" + (f" ({answer.reason})" if answer.reason else ""))
for point in ann.track.points:
    place = np.append(places[round(point.time / STEP)], 0.0)
    error, deviation = (
        np.linalg.norm(point.position - place),
        np.sqrt(np.trace(point.covariance[:3, :3])),
    )
    print(
        f"{point.time:.2f} s: {1e3 * error:.2f} mm off, known to {1e3 * deviation:.2f} mm, "
        f"{np.linalg.norm(point.velocity):.2f} m/s"
    )

fig, ax = plt.subplots(layout="constrained")
ax.plot(*places.T, "o", mfc="none", mec="0.3", ms=10, label="true")
located = [answer.position for answer in ann.answers if answer.position is not None]
ax.plot(*np.array(located).T[:2], "x", color="tab:orange", ms=9, zorder=5, label="located")
way = np.array([point.position for point in ann.track.points])
ax.plot(*way.T[:2], ".-", color="tab:blue", label="track (smoothed)")
for point in ann.track.points:  # 95 % ellipses, ten times as large
    values, axes = np.linalg.eigh(point.covariance[:2, :2])
    turn = np.linspace(0, 2 * np.pi, 60)
    circle = np.stack([np.cos(turn), np.sin(turn)]) * np.sqrt(5.99 * np.maximum(values, 0))[:, None]
    ax.plot(*(point.position[:2, None] + 10 * axes @ circle), color="tab:blue", lw=0.7)
ax.set(xlabel="x [m]", ylabel="y [m]", title="95 % ellipses drawn ten times as large")
ax.set_aspect("equal")
ax.legend()
fig.savefig(folder / "track.png", dpi=150)
