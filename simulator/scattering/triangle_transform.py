r"""The average of a linear phase over a triangle, for NumPy and Dr.Jit alike.

With corner phases :math:`p_i`, :math:`\sum p_i = 0`, it is
:math:`\sum_n \frac{2 j^n}{(n+2)!} h_n(p)` with the complete homogeneous symmetric polynomials
:math:`h_n = -e_2 h_{n-2} + e_3 h_{n-3}`; unlike the quotient of exponentials it has no removable
poles.
"""

import math
from typing import Any

SERIES_DEGREE = 16
"""Degree of the series: for corner phases below π the remainder is below π¹⁷/17! = 8e-7. [-]"""


def triangle_transform(first: Any, second: Any) -> tuple[Any, Any]:
    """Average a linear phase over triangles.

    Parameters
    ----------
    first, second
        Phases at the ends of two edges, relative to the corner that they share; arrays of NumPy
        or Dr.Jit, of any shape. [rad]

    Returns
    -------
    Real and imaginary part of the average of the phase factor, relative to the phase at the
    triangle's centre; (1, 0) for a triangle much smaller than the wavelength. [-]
    """
    mean = (first + second) * (1.0 / 3.0)
    a, b, c = -mean, first - mean, second - mean
    pairs = a * b + b * c + c * a
    product = a * b * c
    polynomials = [1.0 + 0.0 * pairs, 0.0 * pairs, -pairs]
    parts = [polynomials[0], polynomials[1]]
    for degree in range(2, SERIES_DEGREE + 1):
        if degree > 2:
            polynomials.append(-pairs * polynomials[-2] + product * polynomials[-3])
        part = polynomials[degree] * (2.0 / math.factorial(degree + 2))
        if degree % 4 < 2:
            parts[degree % 2] = parts[degree % 2] + part
        else:
            parts[degree % 2] = parts[degree % 2] - part
    return parts[0], parts[1]
