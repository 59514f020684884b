"""Where kernels run: Dr.Jit's backend, and what its kernels share.

Dr.Jit loads LLVM while it is imported, so the backend is chosen here, before that, and nowhere
else. The simulator takes nothing of the estimator but this and the data model.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
