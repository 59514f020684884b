"""What MkDocs is told besides its configuration: equations as MathML, and pages that are made.

The reference of the command line is made from the commands, that of the packages from their
sub-packages, the notebooks' pages by executing them. The page of results is made by
``mmslam validate --record docs/results``; until then a page in its place says so.
"""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

from command_line import command_line_page
from equations import to_mathml
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from module_reference import with_modules
from notebooks import NOTEBOOKS, executed, notebook_page

NO_RESULTS = """# Results

No run is recorded in this copy. Make this page by

```sh
mmslam validate --record docs/results
```

which checks every claim and writes its figures and pictures here (see
[validation](../how_to/validate.md)).
"""


_pages: dict[bytes, str] = {}  # of notebooks by their content: `mkdocs serve` builds often


class _Blocks(Preprocessor):
    """Fences of the language math."""

    FENCE = re.compile(
        r"^(?P<indent> *)```math *\n(?P<body>.*?)^ *``` *$", re.DOTALL | re.MULTILINE
    )

    def run(self, lines: list[str]) -> list[str]:
        """Replace each by its MathML."""

        def replace(found: re.Match[str]) -> str:
            markup = to_mathml(found["body"], block=True)
            stored = self.md.htmlStash.store(f'<div class="equation">{markup}</div>')
            return f"\n{found['indent']}{stored}\n"

        return self.FENCE.sub(replace, "\n".join(lines)).split("\n")


class _Inline(InlineProcessor):
    """Equations within a line, between dollars and backticks."""

    def handleMatch(  # noqa: N802  (the name is Markdown's)
        self, m: re.Match[str], data: str
    ) -> tuple[ElementTree.Element | str, int, int]:
        """Replace one by its MathML."""
        return self.md.htmlStash.store(to_mathml(m[1], block=False)), m.start(0), m.end(0)


class Equations(Extension):
    """Equations for Markdown, written as GitHub reads them too."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802  (the name is Markdown's)
        """Register them before code of any kind."""
        # After the cleaning of whitespace (30), which takes stored markup out, before fences (25).
        md.preprocessors.register(_Blocks(md), "equations", 27)
        md.inlinePatterns.register(_Inline(r"\$`([^`]+)`\$", md), "equations", 200)


@event_priority(100)
def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the equations, before mkdocstrings takes over what the pages use."""
    extensions: list[Any] = config.markdown_extensions
    extensions.append(Equations())
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    from mmslam.cli.app import app

    made = {"reference/command_line.md": command_line_page(app)}
    if not (Path(config.docs_dir) / "results" / "index.md").exists():
        made["results/index.md"] = NO_RESULTS
    for notebook in sorted(NOTEBOOKS.glob("*.ipynb")):
        content = notebook.read_bytes()
        if content not in _pages:
            _pages[content] = notebook_page(executed(notebook), notebook.name)
        made[f"notebooks/{notebook.stem}.md"] = _pages[content]
    for path, text in made.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put the modules of a package where its page has their marker."""
    return with_modules(markdown, Path(config.config_file_path).parent)
