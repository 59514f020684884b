"""How many threads numpy's and scipy's linear algebra takes."""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Compute linear algebra in one thread while this lasts.

    The estimator's matrices are small: a second thread of BLAS gains less than it costs, since it
    waits for work by spinning. Rooms of 128 positions took 1.4 times as long with two threads on a
    busy machine of two cores, and as long on an idle one. Results do not depend on the number of
    cores then, either.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        yield
