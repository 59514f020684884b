"""The reference of a package, made from its tree: one section for each sub-package."""

import ast
from pathlib import Path

MARKER = "<!-- modules of {package} -->"
"""What a page has where a package's sections go."""

LEFT_OUT = {"validation": ("claims", "experiments", "reference")}
"""Sub-packages that are run, not called: :doc:`how_to/validate` says how."""


def with_modules(markdown: str, root: Path) -> str:
    """Replace the markers of a page by the sections of their packages.

    Parameters
    ----------
    markdown
        The page.
    root
        The folder that the packages lie in.
    """
    for package in ("scenes", "simulator", "estimator", "validation", "mmslam"):
        marker = MARKER.format(package=package)
        if marker in markdown:
            markdown = markdown.replace(marker, module_sections(root / package))
    return markdown


def module_sections(package: Path) -> str:
    """List a package's own modules, then those of each sub-package under what it is for."""
    sections = [_modules(package, package.parent)]
    for folder in sorted(one.parent for one in package.glob("*/**/__init__.py")):
        if folder.relative_to(package).parts[0] in LEFT_OUT.get(package.name, ()):
            continue
        about = ast.get_docstring(ast.parse((folder / "__init__.py").read_text("utf-8"))) or ""
        name = ".".join(folder.relative_to(package.parent).parts)
        sections.append(f"## `{name}`\n\n{about}\n\n{_modules(folder, package.parent)}")
    return "\n".join(sections)


def _modules(folder: Path, root: Path) -> str:
    name = ".".join(folder.relative_to(root).parts)
    return "".join(
        f"::: {name}.{file.stem}\n    options:\n      heading_level: 3\n\n"
        for file in sorted(folder.glob("*.py"))
        if not file.stem.startswith("_")
    )
