"""``python -m mmslam``, for where the command is not on the path."""

from mmslam.cli import app

app(prog_name="mmslam")
