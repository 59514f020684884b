"""Independent named random streams: another user or SNR does not change the drawn wall."""

import hashlib

import numpy as np


def random_stream(seed: int, sample: int, name: str) -> np.random.Generator:
    """Return the generator of one named stream.

    Parameters
    ----------
    seed
        Seed of the whole run; zero or more.
    sample
        Number of the sample (the realisation); zero or more.
    name
        What is drawn, such as ``"roughness/wall"`` or ``"noise/echo"``.

    Returns
    -------
    A generator that depends on these three alone, independent of all other streams.

    Raises
    ------
    ValueError
        If the seed or the sample is negative, or the name is empty.
    """
    for key, value in (("seed", seed), ("sample", sample)):
        if value < 0:
            raise ValueError(f"{key} = {value} must not be negative; give 0 or more")
    if not name:
        raise ValueError("a random stream needs a name, such as 'roughness/wall'")
    digest = hashlib.sha256(name.encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()  # the same on every kind of machine
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=(*words, sample))
    return np.random.Generator(np.random.PCG64(sequence))
