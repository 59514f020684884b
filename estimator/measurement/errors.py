"""The error of measurements that cannot be used."""


class MeasurementError(ValueError):
    """A measurement cannot be used; the message names the variable, the value and the remedy."""
