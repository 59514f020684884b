"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

ScenarioName = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A built-in name, or the path of a TOML file.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key by its dotted path, e.g. `objects.wall.angle_deg=35`. Repeatable.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Of roughness and noise.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout, and nothing else.")
]
OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results.")
]
WorkerCount = Annotated[
    int | None,
    typer.Option(
        min=0, help="Processes of one thread each [one for each core]; 0: none but this one."
    ),
]
SchedulerAddress = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="A Dask scheduler whose workers are used in place of --workers."
    ),
]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="Only say how many, how long and how large, by one of them."),
]
RegionX = Annotated[
    tuple[float, float] | None, typer.Option("--x", metavar="FROM TO", help="Region [m].")
]
RegionY = Annotated[
    tuple[float, float] | None, typer.Option("--y", metavar="FROM TO", help="Region [m].")
]
RegionZ = Annotated[
    tuple[float, float] | None, typer.Option("--z", metavar="FROM TO", help="Region [m].")
]
Pixel = Annotated[
    float | None, typer.Option(metavar="METRES", help="Spacing [half the finest resolution].")
]
MinRange = Annotated[
    float | None, typer.Option(metavar="METRES", help="Nearest that is looked at.")
]
MaxRange = Annotated[
    float | None, typer.Option(metavar="METRES", help="Farthest that is looked at.")
]
OutFile = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE.zarr", help="Measurement file to write.")
]
