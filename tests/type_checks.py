"""Check the types and shapes of a function's first calls in each test, not of thousands alike.

A checked call takes some 0.1 ms, as long as what a function on one point or one wall computes:
estimates took a third longer, draws of a thousand errors ten times as long.
"""

import functools
from collections.abc import Callable
from typing import Any

from beartype import beartype

FIRST = 50
"""Calls of each function that are checked in each test: all loops over walls, users and cases of
one test; what is called more often is called in a loop over draws, points or steps. [-]"""

_tests = 0


def begin() -> None:
    """Begin another test: all functions are checked again."""
    global _tests
    _tests += 1


def first_calls(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that beartype checks its first calls in each test."""
    checked: Callable[..., Any] | None = None
    test, calls = 0, 0

    @functools.wraps(function)
    def some_checked(*arguments: Any, **options: Any) -> Any:
        nonlocal checked, test, calls
        if test != _tests:
            test, calls = _tests, 0
        calls += 1
        if calls > FIRST:
            return function(*arguments, **options)
        if checked is None:  # not before: most functions are imported and never called
            checked = beartype(function)
        return checked(*arguments, **options)

    return some_checked
