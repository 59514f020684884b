"""The error that a wave fit raises when it does not converge to a wave."""


class NoWaveError(ArithmeticError):
    """The likelihood has no maximum near a start, or two waves converged to the same one.

    A search for waves stops at this error: the residual of the pilot or the echo holds no further
    wave. Other numerical errors are faults of the program and are not caught.
    """
