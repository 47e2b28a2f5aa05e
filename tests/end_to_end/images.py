"""What every picture must be: large enough, neither blank nor full, in colour."""

import numpy as np
from PIL import Image


def assert_is_a_picture(path, margin=True):
    pixels = np.asarray(Image.open(path).convert("RGB"))
    height, width, _ = pixels.shape
    assert width > 1000 and height > 600
    if margin:
        assert (pixels[:5] == 255).all() and (pixels[:, :3] == 255).all(), "a white margin"
    assert 0.02 < np.mean((pixels != 255).any(axis=2)) < (0.98 if margin else 1.0)
    assert len(np.unique(pixels @ np.array([65536, 256, 1]))) > 50  # colours
    assert path.stat().st_size > 20_000


def texts_of(figure):
    """Everything written on a figure, its legends and first axes included, titles excepted."""
    written = [
        *figure.texts,
        *figure.axes[0].texts,
        *(t for key in figure.legends for t in key.texts),
    ]
    return [text.get_text() for text in written]
