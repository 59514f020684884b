"""Walls in an image: lines and planes found, fitted, bounded, with their uncertainty.

Candidates come from a Hough-like search; lines are placed by the image, then by the whole echo of a
row of unknown scatterers. Covariances are robust to clustered errors: rough walls show few glints.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
