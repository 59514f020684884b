"""Check the types and shapes of a function's first calls in each test, not of thousands alike.

A checked call takes some 0.1 ms, as long as what a function on one point or one wall computes:
estimates took a third longer, draws of a thousand errors ten times as long.
"""

import functools
import sys
from collections.abc import Callable
from typing import Any

from beartype import beartype

FIRST = 50
"""Calls of each function that are checked in each test: all loops over walls, users and cases of
one test; what is called more often is called in a loop over draws, points or steps. [-]"""

_tests = 0
_passed_over: list[Callable[..., Any]] = []  # functions that are not checked until the test ends


class _Checks:
    """What is known of one stand-in that jaxtyping's hook makes of a function of ours."""

    def __init__(self) -> None:
        self.checked: Callable[..., Any] | None = None
        self.test, self.calls = 0, 0

    def exhausted(self) -> bool:
        """Count a call; tell whether enough of them were checked in this test."""
        if self.test != _tests:
            self.test, self.calls = _tests, 0
        self.calls += 1
        return self.calls > FIRST


_of_nested: dict[tuple[str, str, tuple[str, ...]], _Checks] = {}
"""Checks of functions within functions, which are defined anew in each call of the outer one:
beartype writes code for a function in some 4 ms, which was a quarter of the time of estimates.
Two of the same name in one function have the same types: mypy refuses others."""


def begin() -> None:
    """Begin another test: all functions are checked again."""
    global _tests
    _tests += 1
    for function in _passed_over:
        del function.__no_type_check__  # type: ignore[attr-defined]
    _passed_over.clear()


def first_calls(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that beartype checks its first calls in each test.

    ``function`` is one of the two stand-ins of a function of ours, for its arguments and for its
    result. Once enough of its calls were checked, jaxtyping itself is told to pass it over, since
    it binds the arguments of every call by name: a tenth of the time of estimates.
    """
    checks = _Checks()
    if "<locals>" in function.__qualname__:
        names = function.__code__.co_varnames
        checks = _of_nested.setdefault((function.__module__, function.__qualname__, names), checks)

    @functools.wraps(function)
    def some_checked(*arguments: Any, **options: Any) -> Any:
        if checks.exhausted():
            ours = sys._getframe(1).f_locals.get("fn")  # what jaxtyping's wrapper calls
            if ours is not None and not hasattr(ours, "__no_type_check__"):
                ours.__no_type_check__ = True
                _passed_over.append(ours)
            return function(*arguments, **options)
        if checks.checked is None:  # not before: most functions are imported and never called
            checks.checked = beartype(function)
        return checks.checked(*arguments, **options)

    return some_checked
