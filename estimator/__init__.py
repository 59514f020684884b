r"""From a measurement to a map and a position; it never sees the scene.

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

from estimator.compute import engine

engine.prepare()
