"""Walls as mirrors: images, chains of mirrors, rays that are reflected, and their covariance.

A point is *imaged* over a wall (truth to image) and *unfolded* over it (image to truth). Lines in
the plane stand in ``_2d``, planes in space in ``_3d``; the covariance of a path is common to both.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
