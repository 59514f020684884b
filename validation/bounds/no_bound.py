"""The exception raised if a scene has no bound."""


class NoBound(ValueError):  # noqa: N818  an answer, not a fault
    """A scene has no such bound: the parameter is not determined, or no closed form is known."""
