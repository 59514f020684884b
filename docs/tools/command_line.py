"""The reference of the command line as a page, made from the commands themselves."""

from collections.abc import Iterator
from typing import Any

import typer

HEAD = """# Command line

Made from the commands when this site is built. `mmslam COMMAND --help` shows the same.

Exit codes: 0 done (that nothing was found is an answer), 1 falls short (a claim of `validate`, a
sample of `dataset`, a point of `sweep`), 2 bad input, 130 interrupted. With `--json` a command
prints one JSON document on stdout and nothing else; progress goes to stderr.
"""


def command_line_page(app: typer.Typer) -> str:
    """Write the page.

    Parameters
    ----------
    app
        The commands.
    """
    group: Any = typer.main.get_command(app)
    context = group.make_context("mmslam", [], resilient_parsing=True)
    parts = [HEAD, *_options(group, context)]
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        inner = command.make_context(name, [], parent=context, resilient_parsing=True)
        usage = " ".join([f"mmslam {name}", *command.collect_usage_pieces(inner)])
        parts += [f"\n## `mmslam {name}`\n", f"```text\n{usage}\n```\n", f"{command.help}\n"]
        parts += _options(command, inner)
    return "\n".join(parts)


def _options(command: Any, context: Any) -> Iterator[str]:
    rows = []
    for one in command.get_params(context):
        found = one.get_help_record(context)
        if found is None:  # an argument, perhaps without help
            found = (one.make_metavar(context), getattr(one, "help", None) or "")
        name, told = (" ".join(cell.split()) for cell in found)
        rows.append((name, told.replace("|", "&#124;")))  # in code, a bar divides no cells
    if rows:
        yield "| | |\n|---|---|"
        yield from (f"| `{name}` | {told} |" for name, told in rows)
