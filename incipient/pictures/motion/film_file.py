"""Films as files: GIF, or with ffmpeg MP4, under their name only when they are whole."""

from __future__ import annotations

import subprocess
from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from ...errors import OutputError
from ...files import replaced
from ..style import show_as_written

DOTS = 100  # per inch
_PALETTE, _AS_GOOD_AS_WHITE = 128, 247  # colours of a GIF; least part of red, green and blue


class Frames(ABC):
    """A figure that shows one of `count` frames after the other.

    marks: colours of small marks, which a GIF must have though they fill little of a frame
    """

    figure: Figure
    count: int
    marks: tuple[str, ...] = ()

    @abstractmethod
    def show(self, number: int) -> None:
        """Draw a frame in place of the one before."""

    def frame(self, number: int) -> Image.Image:
        """A frame as an RGB picture."""
        self.show(number)
        show_as_written(self.figure)
        self._canvas.draw()
        return Image.fromarray(np.asarray(self._canvas.buffer_rgba())[:, :, :3])

    @cached_property
    def _canvas(self) -> FigureCanvasAgg:
        return FigureCanvasAgg(self.figure)


def write(film: Frames, path: Path, rate: int) -> None:
    """Write a film at so many frames per second in the format that the path ends in; raises OutputError."""
    unfinished = path.with_name(f"{path.stem}.part{path.suffix}")
    with replaced(
        path, unfinished, (subprocess.CalledProcessError, RuntimeError, ValueError)
    ) as part:
        part.touch()
        (_write_mp4 if path.suffix.lower() == ".mp4" else _write_gif)(film, part, rate)


def check(path: Path) -> None:
    """Refuse a name that is not one of a film, and MP4 where there is no ffmpeg."""
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise OutputError(f"{path}: is not a name for an animation; let it end in .gif or .mp4")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise OutputError(
            f"{path}: MP4 needs ffmpeg, which is not installed; install it or write a .gif"
        )


def _write_gif(film: Frames, path: Path, rate: int) -> None:
    """All frames with one palette, chosen from some of them, and without dithering: smaller, and calm."""
    count = film.count
    chosen = [film.frame(k) for k in sorted({0, count // 3, 2 * count // 3, count - 1})]
    palette = Image.fromarray(np.vstack([np.asarray(image) for image in chosen])).quantize(_PALETTE)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > _AS_GOOD_AS_WHITE] = 255
    marks = [[round(255 * part) for part in to_rgb(one)] for one in film.marks]
    colours = np.vstack([colours[:_PALETTE], *marks])
    palette.putpalette(colours.ravel().tolist())
    dither = Image.Dither.NONE
    first, *others = (film.frame(k).quantize(palette=palette, dither=dither) for k in range(count))
    first.save(path, "GIF", save_all=True, append_images=others, duration=1000 // rate, loop=0)


def _write_mp4(film: Frames, path: Path, rate: int) -> None:
    writer = FFMpegWriter(
        fps=rate, codec="h264", extra_args=["-crf", "20", "-movflags", "+faststart"]
    )
    with writer.saving(film.figure, path, DOTS):
        for k in range(film.count):
            film.show(k)
            show_as_written(film.figure)
            writer.grab_frame()
