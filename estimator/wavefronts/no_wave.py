"""What a fit of waves raises where there are none to be fitted."""


class NoWaveError(ArithmeticError):
    """No summit of the likelihood near a start, or two waves that became one.

    A search for waves ends there: what is left of the pilot or the echo is no wave. Any other
    error of the arithmetic is a fault, and is let out.
    """
