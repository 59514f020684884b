"""Physical laws in the simulator: reciprocity, specular chains, slabs, energy."""

import numpy as np
from jaxtyping import Complex
from matplotlib.figure import Figure
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario
from scenes.schema.roughness import Roughness
from simulator.geometry.facets import surface_facets
from simulator.geometry.ray_scene import build_scene, facets_visible
from simulator.materials.fresnel_slab import Dielectric, reflection, transmission
from simulator.materials.permittivity import ConstantPermittivity
from simulator.scattering.physical_optics import scattered
from validation.analytic.canonical_scatterers import half_shadowed_plate, ports
from validation.analytic.sionna_paths import (
    LIMIT_AMPLITUDE,
    LIMIT_LENGTH,
    RandomScene,
    compare_paths,
    random_scene,
)
from validation.experiments.rough_plate_in_space import MATERIALS, backscatter, energy
from validation.harness.claim import Claim, Effort, Finding, Row, Tell


def reciprocity(effort: Effort, tell: Tell) -> Finding:
    """Exchange transmitter and receiver over a rough plate, half in a post's shadow."""
    made = half_shadowed_plate()
    facets = made.facets
    if facets is None:
        raise ValueError("the scene has no facets; give it a scattering object")
    ends = np.array([[-0.15, 0.02, 0.05], [0.1, -0.03, -0.04]])
    one, other = (
        ports(end[None], facets, facets_visible(made.rays, facets, end[None])) for end in ends
    )
    frequencies = made.scenario.radio.frequencies
    there = scattered(facets, one, other, frequencies, waves="spherical")
    back = scattered(facets, other, one, frequencies, waves="spherical")
    tell(1, 1)
    row = Row(
        name="link there against back, relative difference",
        stated="equal, in any medium at rest",
        measured=float(np.linalg.norm(there - back) / np.linalg.norm(there)),
        high=1e-6,
        origin="the sums' accuracy; the usual form with cosθ_i alone is 1.3 % off",
    )
    return Finding(rows=[row])


def chains(effort: Effort, tell: Tell) -> Finding:
    """Compare specular chains with Sionna RT's path solver in random scenes."""
    count = 50 if effort == "full" else 6
    found = []
    for seed in range(count):
        found.append(compare_paths(random_scene(seed)))
        tell(seed + 1, count)
    numbers = np.bincount([n for one in found for n in one.bounces], minlength=4)
    rows = [
        Row(
            name=f"paths in {count} scenes that only one of both found",
            stated="the same chains (hits within 0.1 mm of an edge left out)",
            measured=float(sum(len(one.alone) for one in found)),
            high=0.0,
            origin="both are exact but for rounding at edges",
        ),
        Row(
            name="largest difference of lengths",
            stated="within 1 µm",
            measured=1e6 * max(one.length for one in found),
            unit="µm",
            high=1e6 * LIMIT_LENGTH,
            origin="the solver's single precision: 0.33 µm over 2 m",
        ),
        Row(
            name="largest difference of coefficients",
            stated="within 1 % at the solver's frequency",
            measured=100 * max(one.amplitude for one in found),
            unit="%",
            high=100 * LIMIT_AMPLITUDE,
            origin="the solver's single precision near Brewster's angle and a slab's nulls",
        ),
        Row(
            name="compared paths over two and three mirrors",
            stated="enough to mean something",
            measured=float(numbers[2:].sum()),
            low=2.0 * count,
            origin="two a scene",
        ),
    ]
    bounces = ", ".join(f"{count} over {n}" for n, count in enumerate(numbers))
    return Finding(
        rows=rows,
        draw=lambda figure: _draw_scene(figure, random_scene(0)),
        remarks=(f"Compared paths by number of mirrors: {bounces}.",),
    )


def _draw_scene(figure: Figure, scene: RandomScene) -> None:
    axes = figure.subplots()
    for faces in scene.objects:
        for face in faces:
            closed = np.concatenate([face, face[:1]])
            axes.plot(closed[:, 0], closed[:, 1], color="0.4", linewidth=0.8)
    axes.plot(*scene.points[0, :2], "r^", label="source")
    axes.plot(*scene.points[1:, :2].T, "bo", label="receivers")
    axes.set(title="the first random scene, from above", xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal")
    axes.legend()


def slab(effort: Effort, tell: Tell) -> Finding:
    """Check a slab's ripple and its energy balance."""
    thickness, index = 2.0e-3, 1.6
    plate = Dielectric(
        permittivity=ConstantPermittivity(value=complex(index**2, 0.0)), thickness=thickness
    )
    frequencies = np.linspace(220e9, 295e9, 751)
    cosines = np.ones(1)
    found = reflection(plate, frequencies, cosines)[0].ravel()
    # Airy's formula at normal incidence, from the interface coefficient alone.
    interface = (1 - index) / (1 + index)
    round_trip = np.exp(-4j * np.pi * frequencies * index * thickness / speed_of_light)
    airy = interface * (1 - round_trip) / (1 - interface**2 * round_trip)
    through = transmission(plate, frequencies, cosines)[0].ravel()
    balance = np.abs(found) ** 2 + np.abs(through) ** 2
    tell(1, 1)
    rows = [
        Row(
            name="ripple of a lossless slab against Airy's formula",
            stated="Airy",
            measured=float(np.abs(np.abs(found) - np.abs(airy)).max()),
            high=1e-12,
            origin="rounding",
        ),
        Row(
            name="energy: | |R|² + |T|² − 1 | without loss",
            stated="0",
            measured=float(np.abs(balance - 1).max()),
            high=1e-12,
            origin="rounding; with loss the absorbed part is integrated in the tests",
        ),
    ]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(frequencies / 1e9, 20 * np.log10(np.abs(airy) + 1e-6), "k", label="Airy")
        axes.plot(frequencies / 1e9, 20 * np.log10(np.abs(found) + 1e-6), "--", label="slab")
        axes.set(
            title=f"slab of {thickness * 1e3:g} mm, index {index:g}, normal incidence",
            xlabel="frequency [GHz]",
            ylabel="reflection [dB]",
            ylim=(-50, 0),
        )
        axes.grid(alpha=0.3)
        axes.legend()

    return Finding(rows=rows, draw=draw)


FINER = 8  # default spacing over that of the reference grid [-]


def facet_grid(effort: Effort, tell: Tell) -> Finding:
    """Compare the simulator's facet spacing of a rough wall with coarser and finer ones."""
    scenario = load_scenario(
        "slam_2d",
        [
            "objects.wall.length_m=0.08",
            "objects.wall.centre_m=[0.0, 0.3]",
            "objects.wall.roughness.rms_mm=0.15",
            "objects.wall.roughness.correlation_mm=1.0",
            "radio.points=61",
            "base_station.elements=32",
            "users.user.position_m=[0.4, 0.3]",
        ],
    )
    default = scenario.facet_spacing("wall")
    shares = np.array([4.0, 2.0, 1.0, 0.5, 0.25])
    reference = _wall_echo(scenario, default / FINER)
    errors = []
    for number, share in enumerate(shares.tolist()):
        echo = _wall_echo(scenario, default * share)
        errors.append(float(np.linalg.norm(echo - reference) / np.linalg.norm(reference)))
        tell(number + 1, shares.size)
    wavelength = scenario.radio.shortest_wavelength
    rows = [
        Row(
            name="echo of a rough wall by the default grid, relative error",
            stated=f"that of a grid {FINER} times finer",
            measured=errors[2],
            high=0.15,
            origin="planes between vertices λ/4 and l/4 apart have 4 % less variance of height, "
            "and physical optics itself is 12 % off full wave (correlation 0.993)",
        ),
        Row(
            name="the same with half the spacing, over the default's error",
            stated="1/4 or less: second order",
            measured=errors[3] / errors[2],
            high=0.35,
            origin="the error of linear interpolation, + 0.1 for the next order; the sum over what "
            "is smooth converges faster",
        ),
    ]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.loglog(default * shares / wavelength, errors, "o-")
        axes.axvline(default / wavelength, color="0.5", linestyle=":", label="default")
        axes.set(
            xlabel="spacing over the shortest wavelength [-]", ylabel="relative error of the echo"
        )
        axes.grid(alpha=0.3, which="both")
        axes.legend()

    return Finding(rows=rows, draw=draw)


def _wall_echo(scenario: Scenario, spacing: float) -> Complex[np.ndarray, "positions freqs"]:
    surface = object_surface(scenario, "wall", seed=0, spacing=spacing)
    facets, rays = surface_facets(surface), build_scene([surface], mean=True)
    places = scenario.base_station.element_positions
    array = ports(places, facets, facets_visible(rays, facets, places))
    return scattered(facets, array, array, scenario.radio.frequencies, waves="cylindrical")


def rough_plate(effort: Effort, tell: Tell) -> Finding:
    """Compare rough plates in 3-D with small perturbations and conservation of energy."""
    plates, azimuths = (12, 48) if effort == "full" else (4, 16)
    found = backscatter(plates, azimuths)
    tell(1, 2)
    pairs = list(zip(found[::2], found[1::2], strict=True))
    rows = [
        Row(
            name=f"{material}, backscatter over theory: largest deviation, less twice its error",
            stated="Rice 1951, both polarizations, 30°, 45° and 60°",
            measured=max(
                abs(one.over_theory) - 2 * one.error for one in found if one.material == material
            ),
            unit="dB",
            high=1.0,
            origin="0.15 dB of flat facets, and twice the counting error of speckle",
        )
        for material in MATERIALS
    ]
    rows.append(
        Row(
            name="backscatter of horizontal over vertical antennas, off theory, at most",
            stated="their ratio is that of the polarization amplitudes",
            measured=max(abs(h.over_theory - v.over_theory) for h, v in pairs),
            unit="dB",
            high=0.4,
            origin="the same plates for both: speckle cancels but for the second order (1 %), and "
            "for what edges weigh differently; the tangent plane alone is 7 to 17 dB off",
        )
    )
    roughness = Roughness(rms_mm=0.05, correlation_mm=0.3)
    sums = energy(8 if effort == "full" else 3, 200 if effort == "full" else 60, roughness, 45.0)
    tell(2, 2)
    rows += [
        Row(
            name=f"a lossless plate's power, {one.polarization}, over what came in",
            stated="1: nothing is lost",
            measured=one.whole,
            low=0.95,
            high=1.05,
            origin="third order in k·rms = 0.26; directions and plates are a sample, 3 %",
        )
        for one in sums
    ]
    return Finding(rows=rows)


CLAIMS = (
    Claim(
        key="facet_grid",
        title="Facets are fine enough for rough walls",
        source="convergence; the design's min(λ/4, l/4)",
        measure=facet_grid,
    ),
    Claim(
        key="reciprocity",
        title="Transmitter and receiver may change places",
        source="Lorentz reciprocity",
        measure=reciprocity,
    ),
    Claim(
        key="rough_plate_in_space",
        title="A rough plate in space scatters both polarizations as small perturbations say",
        source="S. O. Rice, Commun. Pure Appl. Math. 4 (1951) 351; conservation of energy",
        measure=rough_plate,
        minutes=3.0,
    ),
    Claim(
        key="specular_chains",
        title="Chains of mirrors are those of Sionna RT's path solver",
        source="PathSolver(deterministic=True), Sionna RT 2.2",
        measure=chains,
        minutes=3.0,
    ),
    Claim(
        key="slab",
        title="Slabs reflect as Airy's formula says and lose no energy",
        source="M. Born, E. Wolf, Principles of Optics, 7.6",
        measure=slab,
    ),
)
