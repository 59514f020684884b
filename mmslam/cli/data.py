"""Commands ``import`` and ``export``: files of other programs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from mmslam.cli.options import AsJson, OutFile
from mmslam.cli.printing import print_json, print_written
from mmslam.plain_text import message, visible
from mmslam.terminal.exit_codes import stdout_kept_clean, told_clearly


def _print_mapping_schema(asked: bool | None) -> None:
    if asked:
        from mmslam.formats.mapping import mapping_schema

        print_json(mapping_schema())
        raise typer.Exit


def import_(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A folder of Touchstone files, or a .mat, HDF5, NetCDF, .csv, .npz or .npy file.",
        ),
    ],
    output: OutFile,
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--mapping",
            "-m",
            metavar="FILE.toml",
            help="Says what in SOURCE is what [SOURCE/mapping.toml, if there is one].",
        ),
    ] = None,
    uplink: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of a full-wave .npz without mapping: its pilot [uplink_beam, else the first].",
        ),
    ] = None,
    schema: Annotated[
        bool | None,
        typer.Option(
            "--schema",
            callback=_print_mapping_schema,
            is_eager=True,
            help="Print the JSON schema of mapping files.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Import measured data into a measurement file, as a mapping file says what is what.

    Without a mapping, SOURCE is a full-wave reference: an .npz with `echo` and `uplink_…`
    (positions x frequencies, complex), `aperture_position` [m] and `frequency` [Hz]; if known,
    `user_position` and `wall_profile`.
    """
    with told_clearly():
        from mmslam.measured_data import import_to_file

        with stdout_kept_clean():
            measurement = import_to_file(source, mapping=mapping, uplink=uplink, path=output)
        for note in measurement.notes:
            typer.echo(message(f"mmslam: note: {note}"), err=True)
        print_written(output, measurement, as_json)


def export(
    measurement: Annotated[
        Path, typer.Argument(metavar="FILE.zarr", help="The measurement or dataset.")
    ],
    touchstone: Annotated[
        Path | None,
        typer.Option(
            "--touchstone", metavar="DIR", help="Folder to write: a file for each position."
        ),
    ] = None,
    netcdf: Annotated[
        Path | None, typer.Option("--netcdf", metavar="FILE.nc", help="NetCDF-4 file to write.")
    ] = None,
    matlab: Annotated[
        Path | None, typer.Option("--matlab", metavar="FILE.mat", help="MATLAB file to write.")
    ] = None,
    hugging_face: Annotated[
        Path | None,
        typer.Option(
            "--huggingface", metavar="DIR", help="Folder to write: a card, and parts by room."
        ),
    ] = None,
    license: Annotated[
        str, typer.Option(metavar="NAME", help="For the card, as the Hugging Face Hub names it.")
    ] = "unknown",
    sample: Annotated[
        list[int] | None,
        typer.Option(
            min=0, help="Which sample, if the file is a dataset. Repeatable, but for --touchstone."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a measurement as Touchstone files, or a dataset as NetCDF, MATLAB or for learning.

    Touchstone files come with the mapping that imports them again; what an earlier export wrote
    to DIR is replaced, a foreign folder refused. NetCDF and MATLAB hold all samples by default,
    with their truth. For learning a dataset is divided by room: train, validation and test.
    """
    with told_clearly():
        if sum(one is not None for one in (touchstone, netcdf, matlab, hugging_face)) != 1:
            raise typer.BadParameter(
                "give one of --touchstone, --netcdf, --matlab and --huggingface"
            )
        if hugging_face is not None:
            from mmslam.learning import export_hugging_face

            if sample is not None:
                raise typer.BadParameter("--huggingface divides all samples; leave --sample out")
            parts = export_hugging_face(measurement, hugging_face, license=license)
            told: dict[str, Any] = {"folder": str(hugging_face), "parts": parts}
            named = ", ".join(f"{part} {count}" for part, count in parts.items())
            line = f"{hugging_face}: {named} samples"
        elif touchstone is not None:
            from mmslam.measured_data import export_to_touchstone

            if sample is not None and len(sample) > 1:
                raise typer.BadParameter("--touchstone takes one --sample at a time")
            count = export_to_touchstone(
                measurement, sample=sample[0] if sample else None, folder=touchstone
            )
            told = {"folder": str(touchstone), "files": count}
            line = f"{touchstone}: {count} Touchstone files"
        else:
            from mmslam.formats.export_arrays import export_matlab, export_netcdf

            if netcdf is not None:
                file, count = netcdf, export_netcdf(measurement, netcdf, samples=sample)
            else:
                assert matlab is not None
                file, count = matlab, export_matlab(measurement, matlab, samples=sample)
            told = {"file": str(file), "variables": count}
            line = f"{file}: {count} variables"
        if as_json:
            print_json(told)
        else:
            typer.echo(visible(line))
