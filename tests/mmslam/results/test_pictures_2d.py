from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.image import imread

from estimator.measurement.model import Measurement
from estimator.results.deferred import Deferred
from estimator.results.estimate import Estimate, Images, no_close_ups
from mmslam import own_results
from mmslam.results.pictures_2d import write_pictures
from validation.metrics.truth import Truth


def test_all_four_figures_are_drawn_and_none_is_blank(
    tmp_path: Path, measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    pictures = write_pictures(tmp_path, measurement, estimate, truth)
    assert sorted(pictures) == sorted(own_results.FIGURES)
    for path in pictures.values():
        pixels = imread(path)
        assert min(pixels.shape[:2]) > 450
        assert np.unique(pixels[..., 0]).size > 50  # a blank figure has a few shades of text


def test_the_same_result_gives_the_same_bytes(
    tmp_path: Path, measurement: Measurement, estimate: Estimate, truth: Truth
) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write_pictures(tmp_path / folder, measurement, estimate, truth)
    for name in own_results.FIGURES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_was_not_measured_has_no_figure(
    tmp_path: Path, measurement: Measurement, nothing_found: Estimate
) -> None:
    deaf = replace(
        nothing_found, images=Deferred(Images), maps=(), close_up_maps=Deferred(no_close_ups)
    )
    pictures = write_pictures(tmp_path, replace(measurement, echo=None), deaf, Truth())
    assert sorted(pictures) == ["localization.png"]
