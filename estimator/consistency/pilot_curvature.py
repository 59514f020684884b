r"""A pilot's delay against the curvature of its wavefronts.

A path of length L over flat mirrors, or none, has the curvature :math:`\kappa = 1/L`. A delay left
in the pilot, a clock that is off, or positions stated in the wrong scale make
:math:`L - 1/\kappa \approx L^2 (\kappa - 1/L)` differ from 0, which an array of aperture D knows to
some :math:`8 L^2 / k D^2` of a phase error.
"""

from collections.abc import Sequence

from estimator.channel.path import PathSet
from estimator.geometry.lateness import Lateness, combined


def pilot_lateness(found: PathSet, used: Sequence[int]) -> Lateness | None:
    """Return by how much the paths that an answer rests on are later than they are curved.

    Parameters
    ----------
    found
        The paths.
    used
        Indices of those that the answer rests on.

    Returns
    -------
    Their mean; None where no curvature was measured.
    """
    told = []
    for index in used:
        free = found.paths[index].free
        length = free.path_length
        if free.curvature_deviation > 0:
            told.append(
                Lateness(
                    shift=length**2 * (free.curvature - 1 / length),
                    deviation=length**2 * free.curvature_deviation,
                    distance=length,
                )
            )
    return combined(told)
