"""Radio SLAM at millimetre and terahertz waves: image a room, find its mirrors, locate users.

The front door for Python; the command line calls the same functions::

    import mmslam
    room = mmslam.load_scenario("slam_2d", {"objects.wall.angle_deg": 40})
    measurement = mmslam.simulate(room, seed=1)
    estimate = mmslam.locate(measurement)
    estimate.plot(truth=measurement.truth)

Names are loaded when they are first used: importing this package imports nothing else.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
