r"""From a measurement to a map and a position; it never sees the scene.

:func:`locate` is the whole way through; the sub-packages are its parts, usable on plain arrays.
The names that the package offers are loaded when they are first used.

Glossary: the thesis' symbol, our name, unit.

=================  ======================  =====
symbol             name                    unit
=================  ======================  =====
:math:`f_n`        ``frequencies``         Hz
:math:`k`          ``wavenumber``          rad/m
:math:`q_m`        ``positions``           m
:math:`s_{mn}`     ``samples``             1
:math:`\theta`      ``aoa``                 rad
:math:`R`          ``path_length``         m
:math:`r_m`        ``distance``            m
:math:`D`          ``aperture_length``     m
:math:`B`          ``bandwidth``           Hz
=================  ======================  =====
"""

import lazy_loader

from estimator.compute import engine

engine.prepare()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
