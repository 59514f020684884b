"""The data model: echo, uplinks, their conventions, and the file that keeps them.

All that the estimator may know. The store is an xarray Dataset in Zarr v3; a truth in it is never
opened here. Calibration takes out what the radio adds: background, cables, its own response.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
