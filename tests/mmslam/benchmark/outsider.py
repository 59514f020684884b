"""Predict both tracks of the test from the stores alone; nothing of mmslam is imported here."""

import sys
from pathlib import Path

import numpy as np
import xarray as xr
import zarr

C = 299_792_458.0


def locate(folder: Path) -> None:
    """Take the strongest cell of the pilot over plane waves and delays as the user."""
    data = xr.open_zarr(folder / "user-test.zarr", consolidated=False)
    x = data["element_position"].values[:, 0]
    f = data["frequency"].values
    cosines, lengths = np.linspace(-0.9, 0.9, 181), np.linspace(0.5, 3.5, 301)
    across = np.exp(-2j * np.pi * f.mean() / C * np.outer(cosines, x))
    along = np.exp(2j * np.pi / C * np.outer(f, lengths))
    lines = ["sample,x_m,y_m"]
    for sample in range(data.sizes["sample"]):
        power = np.abs(across @ data["uplink"].values[sample, 0] @ along)
        row, column = np.unravel_index(np.argmax(power), power.shape)
        place = lengths[column] * np.array([cosines[row], np.sqrt(1 - cosines[row] ** 2)])
        lines.append(f"{sample},{place[0]},{place[1]}")
    (folder / "user.csv").write_text("\n".join(lines) + "\n")


def channel(folder: Path) -> None:
    """Predict free space, by the formula of a link."""
    root = zarr.open_group(folder / "channel-test.zarr", mode="r")
    elements, f = np.asarray(root["element_position"]), np.asarray(root["frequency"])
    rows = np.linspace(0, len(elements) - 1, 16).round().astype(int)
    columns = np.linspace(0, len(f) - 1, 32).round().astype(int)
    lines = ["sample,element,frequency,re,im"]
    for sample, user in enumerate(np.asarray(root["user_position"])):
        away = np.linalg.norm(user - elements[rows], axis=1)[:, None]
        k = 2 * np.pi * f[columns] / C
        values = np.exp(-1j * k * away) / (2 * k * away)
        for i, row in enumerate(rows):
            for j, column in enumerate(columns):
                one = values[i, j]
                lines.append(f"{sample},{row},{column},{float(one.real)!r},{float(one.imag)!r}")
    (folder / "channel.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    locate(Path(sys.argv[1]))
    channel(Path(sys.argv[1]))
    ours = {"mmslam", "simulator", "estimator", "validation", "scenes"}
    assert not ours & {name.partition(".")[0] for name in sys.modules}
