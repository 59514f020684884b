"""The command line: one module for each kind of command, put together in ``app``.

Heavy packages are imported inside the commands that need them: ``--help`` must stay fast, and
only commands that simulate may load the ray tracer.
"""

from mmslam.cli.app import app

__all__ = ["app"]
