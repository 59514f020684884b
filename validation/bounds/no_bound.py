"""What bounds raise where a scene has none."""


class NoBound(ValueError):  # noqa: N818  an answer, not a fault
    """A scene has no bound of this kind: nothing fixes it, or no closed form is known."""
