"""Training, validation and test parts of a dataset that have no room in common.

Two samples of one room have the same rough wall: a network that has seen it in training knows it
in the test, and what it scores there says nothing about another room.
"""

import hashlib
from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from estimator.measurement.model import MeasurementError

PARTS = ("train", "validation", "test")
"""Names of the parts, in the order of their shares."""

SHARES = (0.8, 0.1, 0.1)
"""Shares of the rooms in each part unless others are given. [-]"""


def split_by_room(
    rooms: Int[np.ndarray, " samples"], *, shares: Sequence[float] = SHARES, seed: int = 0
) -> dict[str, Int[np.ndarray, " _"]]:
    """Divide samples among the parts, whole rooms at a time.

    Rooms are put in the order of a digest of seed and room number, so that a room's place depends
    on these two alone. The parts get their shares of the rooms, at least one each.

    Parameters
    ----------
    rooms
        Number of each sample's room.
    shares
        Of training, validation and test; positive, and 1 in sum. [-]
    seed
        Another one gives another division.

    Returns
    -------
    By part, the samples in ascending order.

    Raises
    ------
    MeasurementError
        If there are fewer rooms than parts, or the shares are wrong.

    Examples
    --------
    >>> import numpy as np
    >>> parts = split_by_room(np.array([7, 7, 8, 8, 9, 9]), shares=(0.4, 0.3, 0.3))
    >>> sorted(int(sample) for part in parts.values() for sample in part)
    [0, 1, 2, 3, 4, 5]
    >>> [len(part) for part in parts.values()]
    [2, 2, 2]
    """
    if len(shares) != len(PARTS) or min(shares) <= 0 or abs(sum(shares) - 1) > 1e-9:
        raise MeasurementError(
            f"shares = {tuple(shares)}: give three positive shares ({', '.join(PARTS)}) that sum "
            f"to 1, such as {SHARES}"
        )
    numbers = sorted({int(one) for one in rooms}, key=lambda one: _place(seed, one))
    if len(numbers) < len(PARTS):
        told = "one room" if len(numbers) == 1 else f"{len(numbers)} rooms"
        raise MeasurementError(
            f"all {len(rooms)} samples are in {told}: {len(PARTS)} parts would have the same walls "
            "in training and test. Make a dataset of more rooms ([rooms] count), or keep this one "
            "whole, for training or for a test, beside another one"
        )
    least = [max(1, round(share * len(numbers))) for share in shares[1:]]
    while sum(least) > len(numbers) - 1:  # at least one for training
        least[int(np.argmax(least))] -= 1
    first = len(numbers) - sum(least)
    ends = np.cumsum([first, *least])
    found = {}
    for part, start, end in zip(PARTS, [0, *ends], ends, strict=False):
        found[part] = np.flatnonzero(np.isin(rooms, numbers[int(start) : int(end)]))
    return found


def _place(seed: int, room: int) -> bytes:
    return hashlib.sha256(f"{seed}/{room}".encode()).digest()
