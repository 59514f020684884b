"""Listing, drawing and exporting scenarios."""

import json
from importlib.resources import files
from pathlib import Path

import typer

from mmslam.library import load_scenario, scenarios
from mmslam.output import OutputError, reserved
from mmslam.plain_text import drawn_plainly, json_text, visible
from mmslam.terminal.exit_codes import stdout_kept_clean
from scenes.files.loading import scenario_to_toml
from scenes.files.relocatable import relocatable
from scenes.scenario import Scenario
from scenes.schema.quantities import FORBIDDEN_IN_NAMES


def list_scenarios(*, export: Path | None, as_json: bool) -> None:
    """Print the built-in scenarios, and export all of them if a folder is given."""
    titles = scenarios()
    if export is not None:
        for name in titles:
            _export_toml(load_scenario(name), export)
    if as_json:
        listed = [{"name": name, "title": title} for name, title in titles.items()]
        typer.echo(json_text(listed))
        return
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        typer.echo(visible(f"{name:<{width}}  {title}"))


def show_scenario(
    scenario: Scenario,
    *,
    picture: Path | None,
    export: Path | None,
    seed: int,
    as_json: bool,
    in_space: bool = False,
) -> None:
    """Print a scenario, or draw it, or export it.

    Parameters
    ----------
    scenario
        What is shown.
    picture
        File for its picture; its path is printed instead of the scenario.
    export
        Folder for its TOML, XML and PLY files; likewise.
    seed
        Of the roughness in the exported facets.
    as_json
        Whether the scenario is printed as JSON, not as TOML.
    in_space
        Whether the picture is a page in which the room is turned, not a PNG.
    """
    written = []
    if picture is not None:
        written.append((_lay_out if in_space else _draw)(scenario, picture))
    if export is not None:
        written += _export_toml(scenario, export)
        written += _export_meshes(scenario, export, seed)
        written = list(dict.fromkeys(written))  # both may have written a table of permittivity
    if as_json:
        document = json.loads(scenario.model_dump_json())  # infinity becomes null
        if written:
            document = {"files": [str(path) for path in written], "scenario": document}
        typer.echo(json_text(document))
    elif written:
        for path in written:
            typer.echo(visible(str(path)))
    else:
        typer.echo(visible(scenario_to_toml(scenario).rstrip()))


def write_new(path: Path, *, as_json: bool) -> None:
    """Write a commented scenario, which simulates as it is, to be changed.

    Raises
    ------
    OutputError
        If the file exists with other content, or its name is no TOML file's.
    """
    if path.suffix != ".toml":
        raise OutputError(f"--new {path}: a scenario is a TOML file; call it {path.stem}.toml")
    name = "".join("_" if sign in FORBIDDEN_IN_NAMES else sign for sign in path.stem)
    template = files("mmslam").joinpath("templates/new_scenario.toml").read_text(encoding="utf-8")
    text = template.replace("NAME", name, 1)
    _write_new(path, text.encode())
    typer.echo(json_text({"file": str(path)}) if as_json else visible(str(path)))


def _export_toml(scenario: Scenario, folder: Path) -> list[Path]:
    """Write a scenario with the files that it needs, so that the folder can be moved."""
    moved = relocatable(scenario)
    contents = {f"{scenario.name}.toml": moved.toml.encode()}
    contents |= {name: source.read_bytes() for name, source in moved.files.items()}
    for name, content in contents.items():
        _write_new(folder / name, content)
    return [folder / name for name in contents]


def _export_meshes(scenario: Scenario, folder: Path, seed: int) -> list[Path]:
    with stdout_kept_clean():
        from simulator.export.scene_files import MOST_FROZEN, exported_files, frozen_facets

        if (count := frozen_facets(scenario)) > MOST_FROZEN:
            typer.echo(
                f"its {count:.3g} facets are too many to write (limit {MOST_FROZEN:.3g}): the "
                "smooth scene is exported alone; make objects smaller or less finely rough for "
                "a frozen one",
                err=True,
            )
        written = []
        for name, content in exported_files(scenario, seed=seed):
            _write_new(folder / name, content)
            written.append(folder / name)
    return written


def _write_new(path: Path, content: bytes) -> None:
    if path.is_symlink() or (path.exists() and path.read_bytes() != content):
        raise OutputError(
            f"{path} exists with other content, or is a link; move it away or choose another folder"
        )
    _write(path, content)


def _draw(scenario: Scenario, path: Path) -> Path:
    import io

    from matplotlib.figure import Figure

    with stdout_kept_clean():
        from mmslam.results.pictures_2d import DOTS_PER_INCH
        from simulator.scene.scenario_paths import scenario_paths
        from validation.figures.scenario_plan import draw_scenario
        from validation.figures.scenario_view import draw_view

        paths = scenario_paths(scenario)
    figure = Figure(figsize=(14, 6.6), layout="constrained")
    columns = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.05])
    draw_scenario(figure.add_subplot(columns[0]), scenario, paths)
    draw_view(figure.add_subplot(columns[1], projection="3d"), scenario, paths)
    figure.suptitle(scenario.title or scenario.name)
    drawn = io.BytesIO()
    drawn_plainly(figure)
    figure.savefig(drawn, dpi=DOTS_PER_INCH, format="png", metadata={"Software": None})
    _write(path, drawn.getvalue())
    return path


def _lay_out(scenario: Scenario, path: Path) -> Path:
    if path.suffix != ".html":
        raise OutputError(f"--out {path}: --3d writes a page; call it {path.stem}.html")
    from mmslam.results.page.single_file import can_draw, render_page

    if not can_draw():
        raise OutputError("--3d needs the package plotly, which mmslam asks for; install it")
    with stdout_kept_clean():
        from mmslam.results.page.room import SCRIPTS_ROOM, room_document
        from simulator.scene.scenario_paths import scenario_paths

        document = room_document(scenario, scenario_paths(scenario))
    page = render_page("room.html.j2", document, SCRIPTS_ROOM)
    _write(path, page.encode())
    return path


def _write(path: Path, content: bytes) -> None:
    try:
        with reserved(path) as aside:  # it is there whole, or as it was
            (aside / "new").write_bytes(content)
            (aside / "new").replace(path.resolve())
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}; choose another place") from error
