"""What the one-way field relies on when it multiplies matrices on several threads."""

import numpy as np
from threadpoolctl import threadpool_limits


def test_a_product_has_the_same_bytes_on_one_thread_and_on_more() -> None:
    # The width that one_way_field relies on: 256 columns are added up in one order.
    rng = np.random.default_rng(0)
    left = rng.standard_normal((520, 256)).astype(np.float32)
    right = rng.standard_normal((256, 3000)).astype(np.float32)
    more = left @ right
    with threadpool_limits(limits=1, user_api="blas"):
        assert (left @ right).tobytes() == more.tobytes()
        assert (left[:2] @ right[:, :201]).tobytes() == more[:2, :201].tobytes()
