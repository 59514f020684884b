r"""Focus quality of an image: entropy, and peak and integrated sidelobe ratios.

With the intensity :math:`p = |I|^2 / \sum |I|^2` of each pixel the entropy is
:math:`-\sum p \ln p`: 0 if all is in one pixel, ln N if it is spread evenly over N; its
exponential is an effective number of pixels. Focusing lowers it.

Sidelobe ratios are those of one point's response: of the highest intensity, and of all energy,
outside of the main lobe over that inside. For a rectangular aperture the peak ratio is -13.26 dB,
and the integrated one along a line -9.68 dB.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float

from estimator.results.estimate import Image


@dataclass(frozen=True, kw_only=True)
class SidelobeRatios:
    """Levels of sidelobes relative to the main lobe."""

    peak_db: float  # highest intensity outside over that inside [dB]
    integrated_db: float  # energy outside over that inside [dB]


def image_entropy(values: Complex[np.ndarray, "*grid"]) -> float:
    """Return the entropy of an image's intensity [nat].

    Raises
    ------
    ValueError
        If the image has no energy.
    """
    intensity = np.abs(values) ** 2
    total = float(intensity.sum())
    if not total > 0:
        raise ValueError("the image is zero everywhere; its entropy is not defined")
    share = intensity[intensity > 0] / total
    return float(-(share * np.log(share)).sum())


def sidelobe_ratios(
    values: Complex[np.ndarray, "*grid"], main_lobe: Bool[np.ndarray, "*grid"]
) -> SidelobeRatios:
    """Compare the intensity outside of a main lobe with that inside.

    Parameters
    ----------
    values
        Image of one point, or cut through it; all pixels have the same weight.
    main_lobe
        Which pixels belong to the main lobe, out to its first zeros.

    Raises
    ------
    ValueError
        If the main lobe holds no energy, or includes all pixels.
    """
    intensity = np.abs(values) ** 2
    inside, outside = intensity[main_lobe], intensity[~main_lobe]
    if not inside.sum() > 0 or outside.size == 0:
        raise ValueError(
            f"a main lobe of {inside.size} of {intensity.size} pixels leaves nothing to compare; "
            "give an image wider than the main lobe around its peak"
        )
    with np.errstate(divide="ignore"):  # no sidelobes at all: -inf dB
        return SidelobeRatios(
            peak_db=float(10 * np.log10(outside.max() / inside.max())),
            integrated_db=float(10 * np.log10(outside.sum() / inside.sum())),
        )


def main_lobe(
    image: Image,
    *,
    peak: Float[np.ndarray, " 3"],
    axes: Float[np.ndarray, "axes 3"],
    half_widths: Float[np.ndarray, " axes"],
) -> Bool[np.ndarray, "*grid"]:
    """Return the pixels of a main lobe: a box (of two axes in a plane) around a peak.

    Parameters
    ----------
    image
        With the peak.
    peak
        Its position. [m]
    axes
        Unit vectors along range and across it.
    half_widths
        From the peak to the first zero along each: c/2B and λR/2D for a rectangular echo
        aperture. [m]
    """
    apart = np.abs(np.einsum("...x,ax->...a", image.grid.points - peak, axes))
    return np.asarray(np.all(apart <= half_widths, axis=-1))
