"""Docstrings as they are written (numpy style, reStructuredText) in the site's Markdown."""

import re

_ROLE = re.compile(r":(\w+):`([^`]+)`")
_DIRECTIVE = re.compile(r"^(?P<indent> *)\.\. math::(?P<first>.*)$")
_RULE = re.compile(r"^ *=+(?: +=+)+ *$")
_REFERENCE = re.compile(r"^( *)\.\. \[(\w+)\] ")


def to_markdown(text: str) -> str:
    """Turn a docstring's markup into Markdown; sections such as ``Parameters`` stay.

    Parameters
    ----------
    text
        The docstring, without its indentation.
    """
    lines = _with_tables(_with_equations(text.split("\n")))
    text = "\n".join(_plain(lines))
    return _ROLE.sub(_role, text)


def _role(found: re.Match[str]) -> str:
    kind, body = found[1], " ".join(found[2].split())
    if kind == "math":
        return f"$`{body}`$"
    if "<" in body:  # a text and a target
        return body.split("<")[0].strip()
    return f"`{body.rpartition('.')[2] if body.startswith('~') else body}`"


def _with_equations(lines: list[str]) -> list[str]:
    """Turn each ``.. math::`` with all that is indented below it into a fence."""
    done: list[str] = []
    rest = iter(range(len(lines)))
    for at in rest:
        found = _DIRECTIVE.match(lines[at])
        if found is None:
            done.append(lines[at])
            continue
        indent, body, end = found["indent"], [found["first"].strip()], at + 1
        while end < len(lines) and lines[end].startswith(indent + "   "):
            body.append(lines[end].strip())
            end += 1
        done += [f"{indent}```math", *(indent + line for line in body if line), f"{indent}```"]
        for _ in range(end - at - 1):
            next(rest)
    return done


def _with_tables(lines: list[str]) -> list[str]:
    """Turn a simple table (columns ruled by ``===``) into Markdown's."""
    rules = [at for at, line in enumerate(lines) if _RULE.match(line)]
    if len(rules) < 3:
        return lines
    top, head, bottom = rules[:3]
    starts = [found.start() for found in re.finditer("=+", lines[top])]
    ends = [*starts[1:], None]

    def cells(line: str) -> str:
        parts = [line[a:b].strip() for a, b in zip(starts, ends, strict=True)]
        return f"| {' | '.join(parts)} |"

    table = [cells(lines[top + 1]), "|" + "---|" * len(starts)]
    table += [cells(line) for line in lines[head + 1 : bottom]]
    return [*lines[:top], *table, *_with_tables(lines[bottom + 1 :])]


def _plain(lines: list[str]) -> list[str]:
    done: list[str] = []
    for line in lines:
        if set(line.strip()) == {"-"} and done and done[-1].strip() == "References":
            done[-1] = "**References**"
            continue
        line = _REFERENCE.sub(r"\1- [\2] ", line)
        line = re.sub(r"\[(\w+)\]_", r"[\1]", line)
        if line.endswith("::") and not line.lstrip().startswith(".."):
            line = line[:-1]
        done.append(line)
    return done
