"""What is worked out when somebody looks at it, and then kept."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Deferred(Generic[T]):
    """A value that is made when it is first asked for, and once."""

    make: Callable[[], T]

    @cached_property
    def value(self) -> T:
        """The value itself."""
        return self.make()

    @classmethod
    def of(cls, value: T) -> "Deferred[T]":
        """Wrap what is known already."""
        return cls(lambda: value)
