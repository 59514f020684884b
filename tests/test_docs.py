"""The documentation keeps its word: examples are run, commands and files exist, the site builds.

Fenced blocks of the pages are taken as follows.

- ``toml`` with ``title="FILE"`` (or ``<!-- file: FILE -->`` above it): all blocks of one title
  together are that file; it is read as what it is (a scenario, a dataset, a sweep, a mapping).
  ``<!-- added to: FILE -->`` above a block: the file with it is read too.
- ``python``: run, all blocks of a page one after the other, in a folder with those files and the
  dataset of the tutorial, made smaller, and the table of its sweep, made up.
- ``sh``: commands, options, modules and files must exist; nothing is run.
- ``<!-- not run: why -->`` above a block: only its syntax is checked.
"""

# Over 400 lines: all that the documentation promises is checked in one place.

import ast
import contextlib
import importlib
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from mmslam.cli import app
from mmslam.commands.sweep import STORE
from mmslam.formats.mapping import load_mapping
from scenes.files.loading import load_scenario
from scenes.files.toml_writer import toml_text
from simulator.dataset.builder import make_dataset, plan_dataset
from simulator.dataset.task_runner import Workers
from validation.claims import ALL_CLAIMS
from validation.sweep.sweep import Outcome, plan_sweep
from validation.sweep.tables import error_dataset

CHECKOUT = Path(__file__).resolve().parents[1]
DOCS = CHECKOUT / "docs"
PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam")
PAGES = {
    str(path.relative_to(DOCS)): path.read_text(encoding="utf-8")
    for path in sorted(DOCS.rglob("*.md"))
    if path.parent.name != "results"  # made by `mmslam validate`
}


@dataclass(frozen=True, kw_only=True)
class Block:
    """A fenced block of a page."""

    page: str
    line: int
    language: str
    title: str | None
    mark: str | None  # "not run", "added to" or "file"
    about: str  # why, or which file
    text: str

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(page: str, text: str) -> list[Block]:
    found = []
    pattern = re.compile(
        r"(?:^<!-- (?P<mark>not run|added to|file): (?P<about>[^\n]*?) -->\n)?"
        r'^```(?P<language>\w+)(?: title="(?P<title>[^"]+)")?\n(?P<text>.*?)^```$',
        re.DOTALL | re.MULTILINE,
    )
    for one in pattern.finditer(text):
        found.append(
            Block(
                page=page,
                line=text.count("\n", 0, one.start("text")) + 1,
                language=one["language"],
                title=one["about"] if one["mark"] == "file" else one["title"],
                mark=one["mark"],
                about=one["about"] or "",
                text=one["text"],
            )
        )
    return found


BLOCKS = [block for page, text in PAGES.items() for block in blocks_of(page, text)]
RUN = [block for block in BLOCKS if block.mark != "not run"]


def files() -> dict[str, str]:
    """The files that the pages show, by name."""
    parts: dict[str, list[Block]] = {}
    for block in RUN:
        if block.title is not None:
            parts.setdefault(block.title, []).append(block)
    for title, blocks in parts.items():
        assert len({block.page for block in blocks}) == 1, f"{title} is on several pages"
    return {title: "\n".join(block.text for block in blocks) for title, blocks in parts.items()}


FILES = files()
ADDED = [block for block in RUN if block.mark == "added to"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all files that the pages show."""
    made = tmp_path_factory.mktemp("docs")
    for name, text in FILES.items():
        (made / name).write_text(text, encoding="utf-8")
    return made


def check_file(path: Path) -> None:
    """Read a file as the command would that takes it; refused is an exception."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    if "radio" in tables:
        load_scenario(str(path))
    elif "base" in tables and {"realisations", "axis", "label"} & set(tables):
        plan_sweep(path, path.parent / "cache")
    elif "base" in tables:
        plan_dataset(path, path.parent / "none.zarr")
    else:
        load_mapping(path)


def merged(tables: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    joined = dict(tables)
    for key, value in more.items():
        both = isinstance(value, dict) and isinstance(joined.get(key), dict)
        joined[key] = merged(joined[key], value) if both else value
    return joined


def test_every_toml_block_says_which_file_it_is() -> None:
    for block in BLOCKS:
        if block.language == "toml":
            assert block.title or block.mark, f"{block.place}: give title=, or a comment above it"
            tomllib.loads(block.text)


@pytest.mark.parametrize("name", sorted(FILES))
def test_every_file_that_is_shown_is_read(folder: Path, name: str) -> None:
    check_file(folder / name)


@pytest.mark.parametrize("block", ADDED, ids=[block.place for block in ADDED])
def test_what_is_said_to_be_added_to_a_file_can_be(block: Block, tmp_path: Path) -> None:
    tables = merged(tomllib.loads(FILES[block.about]), tomllib.loads(block.text))
    (tmp_path / block.about).write_text(toml_text(tables), encoding="utf-8")
    check_file(tmp_path / block.about)


def small_dataset(folder: Path) -> None:
    """Make the dataset of the tutorial with a smaller array, fewer frequencies and samples."""
    tables = tomllib.loads(FILES["rooms.toml"])
    tables["count"] = 3
    tables["set"] |= {"base_station.elements": 8, "radio.points": 11, "radio.stop_ghz": 220.75}
    (folder / "small.toml").write_text(toml_text(tables), encoding="utf-8")
    job = plan_dataset(folder / "small.toml", folder / "rooms.zarr")
    assert make_dataset(job, workers=Workers(processes=0)).failed == 0


def made_up_errors(folder: Path) -> None:
    """Write the table of the tutorial's sweep as the command does, with errors made up."""
    job = plan_sweep(folder / "snr.toml", folder / "cache")
    unknown: dict[str, Any] = dict.fromkeys(("deviation", "wall_angle", "wall_offset"))
    outcomes = [
        Outcome(
            point=point,
            realisation=point // job.config.grid_size,
            parameters=job.space.first(point)[0].values,
            user="ann",
            status="found",
            reason=None,
            error=1e-6 * (1 + point),
            bound=1e-6,
            bound_with_walls=1e-6,
            **unknown,
        )
        for point in range(job.config.points)
    ]
    store = folder / "out" / "snr" / STORE
    error_dataset(outcomes, job.config).to_zarr(store, zarr_format=3, consolidated=False)


PYTHON = sorted({block.page for block in RUN if block.language == "python"})


@pytest.mark.parametrize("page", PYTHON)
def test_the_python_of_a_page_runs(
    folder: Path, page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = [block for block in RUN if block.language == "python" and block.page == page]
    if any("rooms.zarr" in block.text for block in code):
        small_dataset(folder)
    if any("errors.zarr" in block.text for block in code):
        made_up_errors(folder)
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    for block in code:
        exec(compile("\n" * (block.line - 1) + block.text, block.page, "exec"), names)
    for picture in re.findall(r'savefig\("([^"]+)"\)', "".join(block.text for block in code)):
        assert (folder / picture).stat().st_size > 1000


def test_python_that_is_not_run_is_python_at_least() -> None:
    for block in BLOCKS:
        if block.language == "python":
            ast.parse(block.text, block.place)
    assert all(block.about for block in BLOCKS if block.mark == "not run")


def commands() -> list[tuple[str, list[str]]]:
    """Every command of the pages' shell blocks, with its place."""
    found = []
    for block in BLOCKS:
        if block.language != "sh":
            continue
        for line in block.text.splitlines():
            for part in re.split(r"&&|;", line.partition("  #")[0]):
                words = shlex.split(part)
                words = words[2:] if words[:2] == ["uv", "run"] else words
                if words:
                    found.append((block.place, words))
    return found


def parse(words: list[str]) -> None:
    """Read a command line of mmslam as the command would, and end there."""
    group: Any = typer.main.get_command(app)
    context = group.make_context("mmslam", words, resilient_parsing=False)
    name, command, rest = group.resolve_command(context, list(context._protected_args))
    with contextlib.suppress(typer.Exit):  # `--schema` answers at once
        command.make_context(name, rest + list(context.args), parent=context)


def test_every_command_of_the_shell_blocks_is_understood() -> None:
    seen = set()
    for place, words in commands():
        if words[0] != "mmslam":
            continue
        seen.add(words[1])
        try:
            parse(words[1:])
        except Exception as error:
            raise AssertionError(f"{place}: {' '.join(words)}: {error}") from error
    group: Any = typer.main.get_command(app)
    assert seen == set(group.commands)  # each is shown somewhere


def test_a_wrong_option_would_be_noticed() -> None:
    with pytest.raises(Exception, match="No such option"):
        parse(["run", "slam_2d", "--sead", "3"])


def test_commands_that_are_named_in_a_line_exist_with_their_options() -> None:
    group: Any = typer.main.get_command(app)
    checked = 0
    for page, text in PAGES.items():
        for found in re.findall(r"`mmslam ([a-z][^`]*)`", text):
            name, *rest = found.split()
            known = {option for one in group.commands[name].params for option in one.opts}
            for word in rest:
                if word.startswith("--"):
                    assert word in known, f"{page}: mmslam {found}: no {word}"
                    checked += 1
    assert checked >= 5


def test_claims_that_commands_name_exist() -> None:
    chosen = [
        (place, words[index + 1])
        for place, words in commands()
        if words[:2] == ["mmslam", "validate"]
        for index, word in enumerate(words)
        if word == "--only"
    ]
    assert chosen
    keys = {claim.key for claim in ALL_CLAIMS}
    for place, key in chosen:
        assert key in keys, f"{place}: --only {key}; known: {', '.join(sorted(keys))}"


def test_modules_and_files_that_commands_name_exist() -> None:
    for place, words in commands():
        if words[:2] == ["python", "-m"]:
            file = CHECKOUT / (words[2].replace(".", "/") + ".py")
            assert file.is_file(), f"{place}: {words[2]}"
        for word in words:
            if word.startswith(("examples/", "validation/", "constraints.txt")):
                assert (CHECKOUT / word).is_file(), f"{place}: {word}"
    for page, text in PAGES.items():
        for word in re.findall(r"`((?:examples|validation)/[\w./]*)`", text):
            assert (CHECKOUT / word).exists(), f"{page}: {word}"


@pytest.mark.parametrize("package", ["scenes", "simulator", "estimator"])
def test_the_reference_holds_every_module_under_its_sub_package(package: str) -> None:
    page = (DOCS / "reference" / f"{package}.md").read_text("utf-8")
    text = tool("module_reference")["with_modules"](page, CHECKOUT)
    named = re.findall(r"^::: ([\w.]+)$", text, flags=re.MULTILINE)
    for name in named:
        assert (CHECKOUT / (name.replace(".", "/") + ".py")).is_file(), name
    modules = {
        ".".join(file.relative_to(CHECKOUT).with_suffix("").parts)
        for file in (CHECKOUT / package).rglob("*.py")
        if not file.stem.startswith("_")
    }
    assert set(named) == modules
    for name in modules:
        *folder, _ = name.split(".")
        section = text.split(f"## `{'.'.join(folder)}`")[-1].split("\n## ")[0]
        assert len(folder) == 1 or f"::: {name}\n" in section


def tool(name: str) -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "tools" / f"{name}.py"))


def test_the_reference_of_the_command_line_holds_every_command_and_option() -> None:
    text = tool("command_line")["command_line_page"](app)
    group: Any = typer.main.get_command(app)
    for name, command in group.commands.items():
        section = text.split(f"\n## `mmslam {name}`\n")[1].split("\n## ")[0]
        for one in command.params:
            for option in one.opts:
                if option.startswith("--"):
                    assert option in section, f"{name}: {option}"


def test_a_fraction_becomes_a_fraction() -> None:
    markup = tool("equations")["to_mathml"](r"\frac{\lambda}{4\pi R^2}", block=False)
    below = "<mrow><mn>4</mn><mi>π</mi><msup><mi>R</mi><mrow><mn>2</mn></mrow></msup></mrow>"
    assert f"<mfrac><mrow><mi>λ</mi></mrow>{below}</mfrac>" in markup


def test_an_equation_that_cannot_be_shown_is_refused() -> None:
    equations = tool("equations")
    for source in (r"\unheardof{x}", r"\frac{1}{2", "x}", r"\begin{align}a\end{align}"):
        with pytest.raises(equations["EquationError"]):
            equations["to_mathml"](source, block=True)


def test_all_equations_of_pages_and_docstrings_can_be_shown() -> None:
    show = tool("equations")["to_mathml"]
    plain = tool("restructured_text")["to_markdown"]
    texts = dict(PAGES)
    for package in PACKAGES:
        for path in (CHECKOUT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef):
                    place = f"{path.relative_to(CHECKOUT)}:{getattr(node, 'lineno', 1)}"
                    texts[place] = plain(ast.get_docstring(node) or "")
    count = 0
    for place, text in texts.items():
        assert ".. math::" not in text, place
        assert ":math:" not in text, place
        inline = re.findall(r"\$`([^`]+)`\$", text)
        for source in [*inline, *re.findall(r"```math\n(.*?)```", text, flags=re.DOTALL)]:
            try:
                ElementTree.fromstring(show(source, block=True))
            except Exception as error:
                raise AssertionError(f"{place}: {error}") from error
            count += 1
    assert count > 300


def test_markup_of_docstrings_becomes_markdown() -> None:
    plain = tool("restructured_text")["to_markdown"]
    assert plain("See :func:`~a.b.c` and :mod:`a.b`.") == "See `c` and `a.b`."
    assert plain("So\n\n.. math:: a +\n          b\n\nthen") == "So\n\n```math\na +\nb\n```\n\nthen"
    table = "=== ==\na   b\n=== ==\n1   2\n=== =="
    assert plain(table) == "| a | b |\n|---|---|\n| 1 | 2 |"


@pytest.mark.slow  # a whole simulation and estimate
def test_the_room_of_the_tutorial_is_located_as_it_says(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = CliRunner().invoke(app, ["run", str(folder / "my_room.toml"), "--json"])
    assert outcome.exit_code == 0, outcome.output
    (user,) = json.loads(outcome.stdout)["users"]
    shown = re.search(
        r"found at \(([\d.]+), ([\d.]+), .* ± ([\d.]+) mm", PAGES["tutorials/own_scene.md"]
    )
    assert shown is not None
    assert user["status"] == "found"
    x, y, deviation = (float(number) for number in shown.groups())
    # Other processors round otherwise; within a deviation it is the same answer.
    assert user["estimate_m"][:2] == pytest.approx([x, y], abs=deviation * 1e-3)
    assert user["error_m"] < 1e-3


@pytest.mark.slow  # ten seconds, and it needs the group `docs`
def test_the_site_builds_without_a_warning_and_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    for needed in ("mkdocs", "material", "mkdocstrings_handlers.python"):
        pytest.importorskip(needed)
    importlib.import_module("mkdocs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    built = subprocess.run(
        command,
        cwd=CHECKOUT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) >= len(PAGES)
    theory = PAGES["theory.md"]
    equations = len(re.findall(r"\$`[^`]+`\$", theory)) + theory.count("```math")
    assert (tmp_path / "theory.html").read_text(encoding="utf-8").count("<math") == equations
    for page in pages:
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(r'<(?:script|img|iframe)[^>]*\ssrc="(https?:[^"]*)"', text)
        fetched += re.findall(r'<link[^>]*\shref="(https?:[^"]*)"', text)
        assert not fetched, f"{page.name}: {fetched}"
        assert "$<code>" not in text, page.name
        assert "wzxhzdk" not in text, f"{page.name}: Markdown has lost an equation"
        assert not re.search(r":(math|func|mod|class|data):<code>", text), page.name
