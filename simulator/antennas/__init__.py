"""Antennas: field patterns, ports, links between them, and where beams reach.

Isotropic, cosine, Gaussian and horn patterns for base station and users. Amplitudes are
S-parameters between ports; 0 dBi unless a pattern says otherwise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
