"""Thesis figure 2.11: a box without line of sight, imaged over a drywall.

Run as ``python -m validation.experiments.fig02_11_nlos_box [FILE.png [SEEDS]]``; a minute of one
core for each seed.

The scenario is ``nlos_box``. What the thesis leaves open, and what was chosen (more of it in the
scenario's header): where wall, box and absorber stand; the box's size (0.10 m); its cardboard
(opaque, permittivity 2.0 - 0.1j, 0.05 mm rms, correlation length 0.3 mm); the drywall as in figure
2.10; noise (20 dB per channel sample). The mirror, marked by hand in the thesis, is found.

A flat face has a specular echo at normal incidence, and a diffuse one from its whole length: it is
imaged as a line. The middle of its visible part is compared with the point of the true face that is
nearest to the array's image. The estimator lists so short a face both as a target and, being flat,
as a mirror seen over the wall.

Claims that are asserted: the mirror is found; the face unfolds to its place, within 1.5 mm along
range and a resolution cell across; no other target is within 10 dB of it.
"""

import sys

from scenes.files.loading import load_scenario
from validation.trials.hidden_imaging import HiddenImaging, conclude_hidden, measure_hidden

HALF_SIZE = (
    "base_station.elements=121",
    "radio.points=501",
    "objects.wall.centre_m=[0.0, 0.3]",
    "objects.wall.length_m=0.15",
    "objects.screen.centre_m=[0.07, 0.125]",
    "objects.screen.length_m=0.15",
    "objects.box.centre_m=[0.21, 0.30]",
    "objects.box.length_m=0.05",
    "objects.box.depth_m=0.05",
)
"""Overrides that halve all lengths, also the array's: the same resolution cells at an eighth of the
work."""


def measure(*, seed: int = 0, quick: bool = False) -> HiddenImaging:
    """Simulate and image one realisation; the quick form is of half the size."""
    scenario = load_scenario("nlos_box", HALF_SIZE if quick else ())
    return measure_hidden(scenario, seed=seed, wall="wall")


def main(arguments: list[str]) -> None:
    """Simulate, draw the first realisation, print the figures and check them."""
    conclude_hidden(arguments, "fig02_11_nlos_box", measure)


if __name__ == "__main__":
    main(sys.argv[1:])
