"""Rooms prone to confidently wrong answers, used by :mod:`validation.experiments.traps`.

Each is a built-in scenario with overrides. Half of the library's size keeps trials short: 128
elements, 251 frequencies (501 if objects or paths exceed the unambiguous 0.5 m of echo range or 1 m
of path), walls 0.4 m away.
"""

HALF_SIZE = (
    "base_station.elements=128",
    "radio.points=251",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
)
FARTHER = (*HALF_SIZE, "radio.points=501")
COARSER = ("objects.wall.roughness.rms_mm=0.1", "objects.wall.roughness.correlation_mm=0.6")
FACING = (*FARTHER, *COARSER)
"""Overrides if walls see each other: coarser facets, with a quarter of the pairs."""


def plate(
    name: str, x: float, y: float, angle: float, length: float, *, coarser: bool = False
) -> tuple[str, ...]:
    """Return the overrides that add a metal plate, as rough as the first wall."""
    key = f"objects.{name}"
    return (
        f"{key}.kind=plate",
        f"{key}.material=metal",
        f"{key}.centre_m=[{x}, {y}]",
        f"{key}.angle_deg={angle}",
        f"{key}.length_m={length}",
        f"{key}.roughness.rms_mm={0.1 if coarser else 0.05}",
        f"{key}.roughness.correlation_mm={0.6 if coarser else 0.3}",
        f"{key}.roughness.spectrum=gaussian",
    )


def screen(x: float, y: float, angle: float, length: float) -> tuple[str, ...]:
    """Return the overrides that add an absorber."""
    return (
        "objects.screen.kind=plate",
        "objects.screen.material=absorber",
        f"objects.screen.centre_m=[{x}, {y}]",
        f"objects.screen.angle_deg={angle}",
        f"objects.screen.length_m={length}",
    )


def wall(x: float, y: float, angle: float, length: float) -> tuple[str, ...]:
    """Return the overrides that put the first wall elsewhere."""
    return (
        f"objects.wall.centre_m=[{x}, {y}]",
        f"objects.wall.angle_deg={angle}",
        f"objects.wall.length_m={length}",
    )


def post(name: str, x: float, y: float, radius: float) -> tuple[str, ...]:
    """Return the overrides that add a metal post."""
    key = f"objects.{name}"
    return (
        f"{key}.kind=cylinder",
        f"{key}.material=metal",
        f"{key}.centre_m=[{x}, {y}]",
        f"{key}.radius_m={radius}",
    )


def user(x: float, y: float, aim: str | None = None) -> tuple[str, ...]:
    """Return the overrides that put the user somewhere, and aim its beam if it has one."""
    place = (f"users.user.position_m=[{x}, {y}]",)
    return place if aim is None else (*place, f"users.user.antenna.aim={aim}")


BEAM, OPEN = "slam_2d", "los_user"
"""Scenarios whose user has a narrow beam, and an isotropic antenna."""

TRAPS: dict[str, tuple[str, tuple[str, ...]]] = {
    "plain": (BEAM, (*HALF_SIZE, *user(0.45, 0.4))),
    # Two parallel walls
    "parallel, over both": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, 45.0, 0.2, coarser=True), *user(0.3, 0.65, "second")),
    ),
    "parallel, a corridor": (
        OPEN,
        (*FACING, *wall(-0.3, 0.3, 90.0, 0.4), *plate("second", 0.3, 0.3, 90.0, 0.4, coarser=True),
         *user(0.1, 0.6)),
    ),
    # A corner
    "corner, in sight": (
        OPEN,
        (*FACING, *wall(0.07, 0.47, 45.0, 0.19),
         *plate("second", 0.21, 0.47, -45.0, 0.19, coarser=True), *user(0.2, 0.22)),
    ),
    "corner, over two walls": (
        BEAM,
        (*FACING, *wall(0.07, 0.47, 45.0, 0.19),
         *plate("second", 0.21, 0.47, -45.0, 0.19, coarser=True), *user(0.22, 0.15, "second")),
    ),
    # A mirror seen edge-on
    "edge-on, before the array": (
        OPEN,
        (*HALF_SIZE, *wall(0.0, 0.3, 90.0, 0.15), *user(0.15, 0.35)),
    ),
    "edge-on, at the side": (
        OPEN,
        (*HALF_SIZE, *wall(0.18, 0.27, 56.3, 0.15), *user(0.09, 0.4)),
    ),
    "edge-on, hides the user": (
        BEAM,
        (*HALF_SIZE, *wall(0.05, 0.3, 85.0, 0.15), *user(0.1, 0.6, "wall")),
    ),
    # Two walls that both could explain the path
    "two staggered walls": (
        BEAM,
        (*HALF_SIZE, *wall(-0.05, 0.35, 45.0, 0.14), *plate("second", 0.05, 0.46, 45.0, 0.14),
         "users.user.antenna.sigma_rad=0.2", *user(0.45, 0.4)),
    ),
    "two walls, a bend": (
        BEAM,
        (*HALF_SIZE, *wall(-0.05, 0.35, 45.0, 0.14), *plate("second", 0.05, 0.455, 50.0, 0.14),
         "users.user.antenna.sigma_rad=0.2", *user(0.45, 0.4)),
    ),
    "two walls, both sides": (
        OPEN,
        (*HALF_SIZE, *COARSER, *wall(-0.2, 0.3, 70.0, 0.2),
         *plate("second", 0.2, 0.3, -70.0, 0.2, coarser=True), *screen(0.02, 0.2, 0.0, 0.08),
         *user(0.03, 0.3)),
    ),
    # A user behind the mirror, and beside it
    "behind, over a wall too far": (
        BEAM,
        (*HALF_SIZE, *COARSER, *plate("second", 0.3, 0.3, 90.0, 0.2, coarser=True),
         *user(0.05, 0.55, "second")),
    ),
    "behind, over a wall in sight": (
        BEAM,
        (*FACING, *plate("second", 0.22, 0.38, 90.0, 0.16, coarser=True),
         *user(-0.02, 0.8, "second")),
    ),
    "behind, over a wall too far aside": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.3, 90.0, 0.2, coarser=True),
         *user(0.05, 0.55, "second")),
    ),
    "behind, past an end": (OPEN, (*FARTHER, *user(0.14, 0.5))),
    "behind": (OPEN, (*HALF_SIZE, *user(-0.05, 0.5))),
    "in sight beside it": (OPEN, (*HALF_SIZE, *user(0.1, 0.2))),
    "in sight and over it": (OPEN, (*HALF_SIZE, *user(0.25, 0.37))),
    # A bright post before the wall
    "post before the wall": (BEAM, (*HALF_SIZE, *post("post", 0.04, 0.3, 0.005), *user(0.45, 0.4))),
    "post in the ray": (BEAM, (*HALF_SIZE, *post("post", 0.0, 0.3, 0.005), *user(0.45, 0.4))),
    "post beside a sight line": (
        OPEN,
        (*HALF_SIZE, *post("post", 0.03, 0.12, 0.005), *user(0.1, 0.25)),
    ),
    "convex mirror": (
        BEAM,
        (*HALF_SIZE, *COARSER, *wall(-0.2, 0.25, 60.0, 0.1), *post("column", 0.07, 0.45, 0.1),
         *user(0.4, 0.38, "column")),
    ),
    # A wall with a doorway
    "doorway, through it": (
        OPEN,
        (*FARTHER, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    "doorway, beside it": (
        BEAM,
        (*FARTHER, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.428, 0.2, "wall")),
    ),
    "narrow doorway, through it": (
        OPEN,
        (*FARTHER, *wall(-0.065, 0.335, 45.0, 0.14), *plate("second", 0.065, 0.465, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    "narrow doorway, beside it": (
        BEAM,
        (*FARTHER, *wall(-0.065, 0.335, 45.0, 0.14), *plate("second", 0.065, 0.465, 45.0, 0.14),
         *user(0.428, 0.22, "wall")),
    ),
    "doorway, beyond what is unambiguous": (
        OPEN,
        (*HALF_SIZE, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    # Walls that are hard to see
    "short second wall, 14 cm": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, -45.0, 0.14, coarser=True),
         *screen(0.16, 0.05, 90.0, 0.35),
         *user(0.3, 0.1, "second")),
    ),
    "short second wall, 7 cm": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, -45.0, 0.07, coarser=True),
         *screen(0.16, 0.05, 90.0, 0.35),
         *user(0.3, 0.1, "second")),
    ),
    "wall 3 cm before the array": (
        BEAM,
        (*HALF_SIZE, *wall(0.02, 0.09, 45.0, 0.12), *user(0.4, 0.09)),
    ),
    "facing wall 3 cm before it": (
        OPEN,
        (*HALF_SIZE, *wall(0.06, 0.03, 0.0, 0.06), *user(-0.1, 0.3)),
    ),
    "smooth wall": (BEAM, (*HALF_SIZE, "objects.wall.roughness.rms_mm=0.0", *user(0.45, 0.4))),
    "smooth wall, its ends in sight": (
        BEAM,
        (*FARTHER, "objects.wall.roughness.rms_mm=0.0", *user(0.45, 0.4)),
    ),
    "smooth wall, hardly rough": (
        BEAM,
        (*HALF_SIZE, "objects.wall.roughness.rms_mm=0.001", *user(0.45, 0.4)),
    ),
    # Paths and clocks
    "too long by 0.15 m": (BEAM, (*HALF_SIZE, *user(0.75, 0.4))),
    "too long by 0.45 m": (BEAM, (*HALF_SIZE, *user(1.05, 0.4))),
    "too long by twice": (BEAM, (*HALF_SIZE, *user(2.0, 0.4))),
    "unknown clock, one path": (
        BEAM,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.45, 0.4)),
    ),
    "unknown clock, one direct path": (
        OPEN,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.1, 0.2)),
    ),
    "unknown clock, two paths": (
        OPEN,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.25, 0.37)),
    ),
    # No mirror-like path
    "wall turned away": (
        BEAM,
        (*HALF_SIZE, "objects.wall.angle_deg=25.0", "objects.wall.roughness.rms_mm=0.15",
         *user(0.4, 0.4)),
    ),
    "wall turned far away": (
        BEAM,
        (*HALF_SIZE, "objects.wall.angle_deg=60.0", "objects.wall.roughness.rms_mm=0.15",
         *user(0.3, 0.2)),
    ),
}  # fmt: skip
"""Scenario and overrides of each trap."""
