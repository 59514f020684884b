"""Errors planted in simulator and estimator (mutation tests): each must make a claim fail.

``python -m validation.harness.planted_errors [NAME…]`` copies the packages, changes one line of the
copy, runs ``mmslam validate --quick`` there on the related claims, and lists the figures that fail.
An error without a failing figure is a gap in the claims.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam")


@dataclass(frozen=True, kw_only=True)
class PlantedError:
    """A wrong replacement of one line of the sources."""

    name: str
    file: str
    right: str  # found exactly once in the file
    wrong: str
    claims: tuple[str, ...]  # to be run: those related to it


PLANTED = (
    PlantedError(
        name="sign of the phase, line of sight in the simulator",
        file="simulator/specular/free_space.py",
        right="phase = np.exp(-2j * np.pi * np.remainder(",
        wrong="phase = np.exp(+2j * np.pi * np.remainder(",
        claims=("points", "line_of_sight"),
    ),
    PlantedError(
        name="sign of the phase, facets in the simulator",
        file="simulator/numerics/nufft_sum.py",
        right="carrier = np.exp(-2j * np.pi * (turns - np.round(turns)))",
        wrong="carrier = np.exp(+2j * np.pi * (turns - np.round(turns)))",
        claims=("canonical_bodies", "full_wave_wall", "fig04_09_slam"),
    ),
    PlantedError(
        name="sign of the phase in the estimator",
        file="estimator/imaging/range_compression.py",
        right='table = scipy.fft.ifft(spectrum, axis=1, norm="forward"',
        wrong='table = scipy.fft.fft(spectrum, axis=1, norm="backward"',
        claims=("points", "pilot_range", "fig04_09_slam"),
    ),
    PlantedError(
        name="image plane 1 mm off in the simulator",
        file="simulator/geometry/mirrors.py",
        right="points - 2.0 * heights[..., None] * self.normals[mirror]",
        wrong="points - 2.0 * (heights[..., None] + 1e-3) * self.normals[mirror]",
        claims=("specular_chains",),
    ),
    PlantedError(
        name="image plane 1 mm off in the estimator",
        file="estimator/geometry/wall_2d.py",
        right="((points - start) @ normal)[..., None] * normal",
        # Directions are mirrored about the origin, and stay unchanged.
        wrong="((points - start) @ normal + 1e-3 * bool(np.any(start)))[..., None] * normal",
        claims=("fig04_09_slam",),
    ),
    PlantedError(
        name="one-way for two-way range",
        file="estimator/imaging/range_compression.py",
        right="two_way = isinstance(data, Echo) and data.transmit_positions is None",
        wrong="two_way = False",
        claims=("points", "fig04_09_slam"),
    ),
    PlantedError(
        name="missing Jacobian of the Stolt step",
        file="estimator/imaging/wavenumber/stolt.py",
        right="weight = dr.select(inside, scale * sector * jacobian, 0.0)",
        wrong="weight = dr.select(inside, scale * sector, 0.0)",
        claims=("image_formers",),
    ),
    PlantedError(
        name="facets as long as a wavelength",
        file="scenes/surfaces/facet_spacing.py",
        right="FACETS_PER_CUTOFF)\n    return spacing",
        wrong="FACETS_PER_CUTOFF)\n    return shortest_wavelength",
        claims=("facet_grid",),
    ),
    PlantedError(
        name="Bragg kernel of the other polarization",
        file="simulator/scattering/weighted_curvature_3d.py",
        right="return self._constant + 2.0 * (one * other - fields)",
        wrong="return self._constant + 2.0 * (fields - one * other)",
        claims=("rough_plate_in_space",),
    ),
    PlantedError(
        name="Bragg kernel of the other polarization in two dimensions",
        file="simulator/scattering/small_slope_2d.py",
        right="bragg = -2 * q_i * q_s if vertical else 2 * (1 + t_i * t_s)",
        wrong="bragg = -2 * (1 + t_i * t_s) if vertical else 2 * q_i * q_s",
        claims=("full_wave_roughness",),
    ),
    PlantedError(
        name="fringe currents of the wrong sign",
        file="simulator/scattering/edge_diffraction.py",
        right="return np.asarray(incident - sign * reflected - sign * flat)",
        wrong="return -np.asarray(incident - sign * reflected - sign * flat)",
        claims=("full_wave_roughness",),
    ),
    PlantedError(
        name="rough walls hide themselves",
        file="simulator/scene/radio_scene.py",
        right="rays=build_scene(opaque(surfaces, slabs), mean=True)",
        wrong="rays=build_scene(opaque(surfaces, slabs), mean=False)",
        claims=("full_wave_roughness",),
    ),
    PlantedError(
        name="random phases at every position",
        file="simulator/response/echo.py",
        right="    return np.asarray(echo + ghosts)\n",
        wrong="    turns = np.random.default_rng(0).random((len(echo), 1))\n"
        "    return np.asarray((echo + ghosts) * np.exp(2j * np.pi * turns))\n",
        claims=("canonical_bodies", "fig04_09_slam"),
    ),
)


@dataclass(frozen=True, kw_only=True)
class Noticed:
    """Claims that failed by a planted error."""

    error: PlantedError
    red: tuple[str, ...]  # "claim: figure", or the claim that raised

    @property
    def passed(self) -> bool:
        """Whether at least one figure failed."""
        return bool(self.red)


def plant(error: PlantedError, folder: Path) -> None:
    """Copy the packages to a folder and replace one line there.

    Raises
    ------
    ValueError
        If the line does not occur exactly once: the list of errors is out of date.
    """
    for package in PACKAGES:
        source = Path(str(files(package)))
        shutil.copytree(source, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    path = folder / error.file
    text = path.read_text(encoding="utf-8")
    if text.count(error.right) != 1:
        raise ValueError(
            f"{error.name}: {error.file} holds {error.right!r} {text.count(error.right)} times; "
            "once is needed, so bring the list of planted errors up to date"
        )
    path.write_text(text.replace(error.right, error.wrong), encoding="utf-8")


def noticed(error: PlantedError) -> Noticed:
    """Run the claims on sources with an error, and collect the failures.

    Raises
    ------
    RuntimeError
        If the claims could not be run at all.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plant(error, folder)
        command = [sys.executable, "-P", "-c", _START, str(folder), "validate", "--quick", "--json"]
        for claim in error.claims:
            command += ["--only", claim]
        command += ["--out", str(folder / "run")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{error.name}: exit code {done.returncode}\n{done.stderr[-2000:]}")
    red = []
    for claim in json.loads(done.stdout)["claims"]:
        if claim["problem"] is not None:
            red.append(f"{claim['key']}: {claim['problem'].splitlines()[0][:100]}")
        for row in claim["rows"]:
            if not row["passed"]:
                red.append(f"{claim['key']}: {row['name']} = {row['measured']} {row['unit']}")
    return Noticed(error=error, red=tuple(red))


# The copy is imported in place of the installed packages.
_START = (
    "import sys; sys.path.insert(0, sys.argv.pop(1)); "
    "import mmslam.cli; mmslam.cli.app(prog_name='mmslam')"
)


def main(arguments: list[str]) -> int:
    """Plant the errors whose names contain an argument, or all; return 1 if one is not noticed."""
    chosen = [e for e in PLANTED if not arguments or any(a in e.name for a in arguments)]
    missed = 0
    for error in chosen:
        found = noticed(error)
        print(f"{'noticed' if found.passed else 'MISSED'}: {error.name}", flush=True)
        for line in found.red:
            print(f"    {line}", flush=True)
        missed += not found.passed
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
