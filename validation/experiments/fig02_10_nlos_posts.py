"""Thesis figure 2.10: two metal posts without line of sight, imaged over a drywall.

Run as ``python -m validation.experiments.fig02_10_nlos_posts [FILE.png [SEEDS]]``; half a minute of
one core for each seed.

The scenario is ``nlos_posts``. What the thesis leaves open, and what was chosen (more of it in the
scenario's header): where wall, posts and absorber stand; the posts' radius (5 mm); the drywall's
permittivity (ITU-R P.2040-4) and roughness (0.02 mm rms, correlation length 0.3 mm: no value is
settled at these frequencies); noise (20 dB per channel sample). The thesis marks the mirror in the
image by hand and rotates the ghosts by 180° - 2θ about it; here the mirror is detected, and ghosts
are mirrored about it, which is equivalent.

Corrections: (2-9) to (2-14) focus with the wrong sign for exp(+jωt), and lack the interpolation of
wavenumbers (Stolt); the image here is formed by back-projection, which needs neither. A post is
said to be imaged "at its place"; an image shows its front face, one radius nearer to the array's
image in the wall.

Claims that are asserted: the mirror is found; both ghosts unfold onto front faces, within 1.5 mm
along range and a resolution cell across; no other target is within 10 dB of the weaker one.
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
    "objects.near_post.centre_m=[0.15, 0.28]",
    "objects.near_post.radius_m=0.0025",
    "objects.far_post.centre_m=[0.20, 0.32]",
    "objects.far_post.radius_m=0.0025",
)
"""Overrides that halve all lengths, also the array's: the same resolution cells at an eighth of the
work."""


def measure(*, seed: int = 0, quick: bool = False) -> HiddenImaging:
    """Simulate and image one realisation; the quick form is of half the size."""
    scenario = load_scenario("nlos_posts", HALF_SIZE if quick else ())
    return measure_hidden(scenario, seed=seed, wall="wall")


def main(arguments: list[str]) -> None:
    """Simulate, draw the first realisation, print the figures and check them."""
    conclude_hidden(arguments, "fig02_10_nlos_posts", measure)


if __name__ == "__main__":
    main(sys.argv[1:])
