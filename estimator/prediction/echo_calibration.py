"""How far an echo's levels are those between antenna ports, where nothing tells: assumed."""

CALIBRATED = 0.5
"""Probability that the array's antennas are isotropic, and the echo is calibrated: as of users'
(:data:`estimator.positioning.level_likelihood.ISOTROPIC`). [-]"""
GAINS_DB = 90.0
"""Range of the gain out and back otherwise: -40 to 50 dB. [dB]"""
