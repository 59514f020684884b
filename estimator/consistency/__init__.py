"""Whether data agree with themselves: delays against curvatures, echo against pilot.

What a measurement tells twice is compared; what disagrees by more than its error widens the
answer's covariance, or leaves it open.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
