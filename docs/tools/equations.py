"""Equations of docstrings and pages, from LaTeX to MathML, which browsers show without a script.

Only what the project's equations use is known; anything else is refused, so that the build fails
where an equation would show wrongly.
"""

# ruff: noqa: RUF001  (letters that look like others are meant)

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape

_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|[^\s]|\s+", re.DOTALL)

_SYMBOLS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "varepsilon": "ε", "epsilon": "ϵ",
    "zeta": "ζ", "eta": "η", "theta": "θ", "vartheta": "ϑ", "kappa": "κ", "lambda": "λ", "mu": "μ",
    "nu": "ν", "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "ϕ",
    "varphi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ",
    "Lambda": "Λ", "Sigma": "Σ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", "ell": "ℓ", "partial": "∂",
    "infty": "∞", "Re": "Re", "Im": "Im", "dots": "…", "ldots": "…", "cdots": "⋯",
}  # fmt: skip
_OPERATORS = {
    "cdot": "⋅", "times": "×", "le": "≤", "leq": "≤", "ge": "≥", "geq": "≥", "ne": "≠", "ll": "≪",
    "gg": "≫", "approx": "≈", "sim": "∼", "pm": "±", "mp": "∓", "to": "→",
    "leftrightarrow": "↔", "in": "∈", "propto": "∝",
    "parallel": "∥", "perp": "⟂", "nabla": "∇", "equiv": "≡", "mid": "|", "circ": "∘",
}  # fmt: skip
_FENCES = {
    "lVert": "‖", "rVert": "‖", "lvert": "|", "rvert": "|", "langle": "⟨", "rangle": "⟩",
    "{": "{", "}": "}", "lfloor": "⌊", "rfloor": "⌋",
}  # fmt: skip
_SUMS = {"sum": "∑", "prod": "∏"}
_INTEGRALS = {"int": "∫", "iint": "∬", "oint": "∮"}
_FUNCTIONS = {
    "cos", "sin", "tan", "arcsin", "arccos", "arctan", "cosh", "sinh", "tanh", "exp", "ln", "log",
    "arg", "det",
}  # fmt: skip
_LIMITS = {"max", "min", "sup", "inf", "lim"}
_SPACES = {",": 0.17, ":": 0.22, ";": 0.28, " ": 0.3, "!": -0.17, "quad": 1.0, "qquad": 2.0}
_ACCENTS = {"hat": "^", "bar": "‾", "tilde": "~", "vec": "→", "dot": "˙"}
_STYLES = {"mathbf": "bold", "boldsymbol": "bold-italic", "mathsf": "sans", "mathrm": "upright"}
_BIG = re.compile(r"\\(?:big|Big|bigg|Bigg)[lr]?")
_MATRICES = {"pmatrix": "()", "bmatrix": "[]", "matrix": "", "vmatrix": "||"}


class EquationError(ValueError):
    """An equation uses what is not known here."""


@dataclass(frozen=True)
class _Atom:
    """One thing that may carry an index or an exponent."""

    markup: str
    limits: bool = False  # index and exponent below and above it
    function: bool = False  # a small space follows


def to_mathml(source: str, *, block: bool) -> str:
    r"""Write an equation as MathML.

    Parameters
    ----------
    source
        In LaTeX, without dollars.
    block
        Whether it stands on a line of its own.

    Raises
    ------
    EquationError
        If it uses a command that is not known, or its braces do not match.
    """
    parser = _Parser(source)
    inside = parser.row(end=None)
    display = ' display="block"' if block else ""
    told = escape(" ".join(source.split()), quote=True)
    return f'<math{display} alttext="{told}"><mrow>{inside}</mrow></math>'


class _Parser:
    def __init__(self, source: str) -> None:
        self.source = source
        self.tokens = [t for t in _TOKEN.findall(source)]
        self.at = 0

    def fail(self, why: str) -> EquationError:
        return EquationError(f"{why} in the equation {' '.join(self.source.split())!r}")

    def peek(self) -> str | None:
        """Return the next token that is no blank, without taking it."""
        while self.at < len(self.tokens) and self.tokens[self.at].isspace():
            self.at += 1
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def take(self) -> str:
        token = self.peek()
        if token is None:
            raise self.fail("something is missing at the end")
        self.at += 1
        return token

    def row(self, end: str | None, *more_ends: str) -> str:
        """Read up to an end, which is left to the caller; ``None`` is the end of the source."""
        return "".join(self._pieces(end, more_ends))

    def _pieces(self, end: str | None, more_ends: tuple[str, ...]) -> Iterator[str]:
        while (token := self.peek()) is not None:
            if token == end or token in more_ends:
                return
            atom = self.atom(allow_number=True)
            yield self.scripts(atom)
            if atom.function and self.peek() not in ("(", "[", None, ")", end):
                yield '<mspace width="0.17em"/>'
        if end is not None:
            raise self.fail(f"{end} is missing")

    def scripts(self, atom: _Atom) -> str:
        """Read indices and exponents of an atom."""
        below = above = ""
        while (token := self.peek()) in ("_", "^", "'"):
            self.at += 1
            if token == "'":
                above += "<mo>′</mo>"
            elif token == "_":
                below += self.argument()
            else:
                above += self.argument()
        kinds = ("munder", "mover", "munderover") if atom.limits else ("msub", "msup", "msubsup")
        if below and above:
            return f"<{kinds[2]}>{atom.markup}{_row(below)}{_row(above)}</{kinds[2]}>"
        if below:
            return f"<{kinds[0]}>{atom.markup}{_row(below)}</{kinds[0]}>"
        if above:
            return f"<{kinds[1]}>{atom.markup}{_row(above)}</{kinds[1]}>"
        return atom.markup

    def argument(self) -> str:
        """Read a group in braces, or one token."""
        if self.peek() == "{":
            return self.group()
        return self.atom(allow_number=False).markup

    def group(self) -> str:
        if self.take() != "{":
            raise self.fail("{ is missing")
        inside = self.row("}")
        self.take()
        return _row(inside)

    def raw(self) -> str:
        """Read the characters of a group as they are."""
        if self.take() != "{":
            raise self.fail("{ is missing")
        text = ""
        while self.at < len(self.tokens) and self.tokens[self.at] != "}":
            text += self.tokens[self.at]
            self.at += 1
        self.take()
        return text

    def atom(self, *, allow_number: bool) -> _Atom:
        token = self.take()
        if token == "{":
            self.at -= 1
            return _Atom(self.group())
        if token.startswith("\\") and len(token) > 1:
            return self.command(token)
        if token.isdigit():
            while allow_number and self.at < len(self.tokens):
                following = self.tokens[self.at]
                ahead = self.tokens[self.at + 1] if self.at + 1 < len(self.tokens) else ""
                if not (following.isdigit() or (following == "." and ahead.isdigit())):
                    break
                token += following
                self.at += 1
            return _Atom(f"<mn>{token}</mn>")
        if token.isalpha():
            return _Atom(f"<mi>{token}</mi>")
        if token in "^_":  # an exponent of nothing
            self.at -= 1
            return _Atom("<mrow></mrow>")
        if token in "}&":
            raise self.fail(f"{token} where nothing is open")
        shown = {"-": "−", "*": "∗"}.get(token, token)
        fixed = ' stretchy="false"' if token in "()[]|" else ""
        fixed += ' lspace="0" rspace="0"' if token in "|/" else ""
        return _Atom(f"<mo{fixed}>{escape(shown)}</mo>")

    def command(self, token: str) -> _Atom:
        name = token[1:]
        if name in _SYMBOLS:
            upright = ' mathvariant="normal"' if name in ("partial", "infty") else ""
            return _Atom(f"<mi{upright}>{_SYMBOLS[name]}</mi>")
        if name in _OPERATORS:
            return _Atom(f"<mo>{escape(_OPERATORS[name])}</mo>")
        if name in _FENCES:
            return _Atom(f'<mo stretchy="false">{_FENCES[name]}</mo>')
        if name in _SUMS:
            return _Atom(f"<mo>{_SUMS[name]}</mo>", limits=True)
        if name in _INTEGRALS:
            return _Atom(f"<mo>{_INTEGRALS[name]}</mo>")
        if name in _FUNCTIONS:
            return _Atom(f"<mi>{name}</mi>", function=True)
        if name in _LIMITS:
            return _Atom(f"<mi>{name}</mi>", limits=True, function=True)
        if name in _SPACES:
            return _Atom(f'<mspace width="{_SPACES[name]}em"/>')
        if _BIG.fullmatch(token):
            return self.fence(stretchy=False)
        return self.construction(name)

    def construction(self, name: str) -> _Atom:
        """Read a command that takes something."""
        if name in ("frac", "tfrac", "dfrac"):
            markup = f"<mfrac>{self.argument()}{self.argument()}</mfrac>"
            small = f'<mstyle displaystyle="false">{markup}</mstyle>'
            return _Atom(small if name == "tfrac" else markup)
        if name == "sqrt":
            if self.peek() == "[":
                self.take()
                index = self.row("]")
                self.take()
                return _Atom(f"<mroot>{self.argument()}{_row(index)}</mroot>")
            return _Atom(f"<msqrt>{self.argument()}</msqrt>")
        if name in _ACCENTS:
            accent = f'<mo stretchy="false">{_ACCENTS[name]}</mo>'
            return _Atom(f'<mover accent="true">{self.argument()}{accent}</mover>')
        if name in ("text", "operatorname"):
            kind = "mtext" if name == "text" else "mi"
            return _Atom(f"<{kind}>{escape(self.raw())}</{kind}>", function=kind == "mi")
        if name in _STYLES:
            return _Atom(self.styled(_STYLES[name]))
        if name == "left":
            opening = self.fence(stretchy=True).markup
            inside = self.row(r"\right")
            self.take()
            return _Atom(f"<mrow>{opening}{inside}{self.fence(stretchy=True).markup}</mrow>")
        if name == "begin":
            return _Atom(self.matrix())
        raise self.fail(f"\\{name} is not known to docs/tools/equations.py; add it there, or do "
                        "without")  # fmt: skip

    def fence(self, *, stretchy: bool) -> _Atom:
        token = self.take()
        shown = "" if token == "." else _FENCES.get(token.removeprefix("\\"), token)
        return _Atom(f'<mo stretchy="{str(stretchy).lower()}">{escape(shown)}</mo>')

    def styled(self, style: str) -> str:
        """Read a letter or a group in another style."""
        if self.peek() == "{":
            text = self.raw().strip()
        else:
            text = self.take()
        symbol = _SYMBOLS.get(text.removeprefix("\\"), text)
        if symbol.startswith("\\"):
            raise self.fail(f"{symbol} in another style")
        if style == "upright":
            return f'<mi mathvariant="normal">{escape(symbol)}</mi>'
        return f'<mi class="{style}">{escape(symbol)}</mi>'

    def matrix(self) -> str:
        kind = self.raw()
        if kind not in _MATRICES:
            raise self.fail(f"\\begin{{{kind}}} is not known to docs/tools/equations.py")
        rows, cells = [], []
        while True:
            cells.append(f"<mtd>{self.row('&', chr(92) * 2, chr(92) + 'end')}</mtd>")
            ended_by = self.take()
            if ended_by == "&":
                continue
            rows.append(f"<mtr>{''.join(cells)}</mtr>")
            cells = []
            if ended_by == r"\end":
                break
        self.raw()
        opening, closing = (f"<mo>{c}</mo>" for c in _MATRICES[kind] or ("", ""))
        return f"<mrow>{opening}<mtable>{''.join(rows)}</mtable>{closing}</mrow>"


def _row(inside: str) -> str:
    return f"<mrow>{inside}</mrow>"
