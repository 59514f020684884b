"""Files of other programs: measured data in, measurements and datasets out.

Touchstone, MATLAB, HDF5, NetCDF, CSV and NumPy files are read as a mapping file says; unlikely
values (wrong units, wrong sign) are noted or refused. No pickled object is ever loaded.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
