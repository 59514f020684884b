"""Notebooks: executed, and shown as pages of the documentation with what they print and draw."""

import os
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

CHECKOUT = Path(__file__).resolve().parents[2]
NOTEBOOKS = CHECKOUT / "examples" / "notebooks"

PATIENCE = 600
"""How long one cell may take, also where many programs share the processors. [s]"""

INLINE = "module://matplotlib_inline.backend_inline"
"""Matplotlib's backend in a notebook: figures become outputs."""


def executed(path: Path) -> Any:
    """Execute a notebook in an empty folder of its own; the file stays as it is.

    Parameters
    ----------
    path
        The notebook.

    Returns
    -------
    It, with its outputs.

    Raises
    ------
    CellExecutionError
        If a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    environment = os.environ | {"MPLBACKEND": INLINE, "PYTHONPATH": str(CHECKOUT)}
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=PATIENCE,
            kernel_name="python3",
            extra_arguments=["--Application.log_level=40"],  # errors only
            resources={"metadata": {"path": folder}},
        )
        client.execute(env=environment)
    return notebook


def notebook_page(notebook: Any, name: str) -> str:
    """Write a notebook with its outputs as Markdown.

    Parameters
    ----------
    notebook
        As :func:`executed` returns it.
    name
        Of its file.
    """
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        parts += [shown for output in cell.outputs if (shown := _output(output))]
    place = f"*This page is the notebook `examples/notebooks/{name}`, executed.*"
    return "\n\n".join([parts[0], place, *parts[1:]]) + "\n"


def _output(output: Any) -> str:
    if output.output_type == "stream":
        return f"```text\n{output.text.rstrip()}\n```" if output.name == "stdout" else ""
    data = output.get("data", {})
    if "image/png" in data:
        png = "".join(data["image/png"].split())
        return f'<img src="data:image/png;base64,{png}" alt="figure">'
    if "text/html" in data and "<style" not in data["text/html"]:
        return "".join(data["text/html"].splitlines())
    return f"```text\n{data['text/plain']}\n```" if "text/plain" in data else ""
