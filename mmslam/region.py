"""The region that an image or an estimate is asked to look at."""

from estimator.imaging.scene_image import ImageOptions

Bounds = tuple[float | None, float | None]
ANY: Bounds = (None, None)


def asked_region(
    *, x: Bounds, y: Bounds, z: Bounds, pixel: float | None, near: float | None, far: float | None
) -> ImageOptions | None:
    """Put a region together; None if nothing was asked for.

    Parameters
    ----------
    x, y, z
        First and last coordinate, in the world's frame; None: chosen. [m]
    pixel
        Spacing of the pixels. [m]
    near, far
        Distances from the positions. [m]
    """
    options = ImageOptions(
        low=(x[0], y[0], z[0]),
        high=(x[1], y[1], z[1]),
        pixel=pixel,
        nearest=near,
        farthest=far,
    )
    return None if options == ImageOptions() else options
