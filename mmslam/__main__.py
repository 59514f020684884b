"""Entry point of ``python -m mmslam``, for when the command is not on the PATH."""

from mmslam.cli import app

app(prog_name="mmslam")
