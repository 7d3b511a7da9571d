"""Films and images of a saved scene (.mp4, .gif, .png), drawn by a headless browser."""

from __future__ import annotations

import io
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from tqdm.auto import tqdm

from floatbase._browser import browser_path
from floatbase._files import whole_file
from floatbase._validation import as_array, short_repr
from floatbase.errors import InputError, MissingDependencyError, ViewerError
from floatbase.viewer.scene.colours import LEGEND

if TYPE_CHECKING:
    from PIL.Image import Image

# pictures per second of each file type; 0: only the first one
FRAME_RATES = {".png": 0, ".mp4": 30, ".gif": 20}
_MAX_DURATION = 120.0  # s
_MIN_PIXELS, _MAX_PIXELS = 100, 4000  # pixels
_FLAGS = [
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic",
]  # fmt: skip
_TIMEOUT_MS = 60_000  # ms until the page must have drawn
_REQUIREMENTS = (
    "Films and images need a browser (Chromium or Chrome) and two packages: pip install "
    '"floatbase[video]". An .html file needs neither.'
)
_IS_DRAWN = "() => window.viewer && viewer.num_messages_received > 0"
_PREPARE_JS = """() => {
    const {animator} = viewer;
    document.body.classList.remove("has-panel");
    const controls = "#player, #panel, #fold, #board, #tools, #legend.folded";
    for (const one of document.querySelectorAll(controls)) one.style.visibility = "hidden";
    if (!animator.duration) return 0;
    animator.pause();
    return animator.duration / animator.mixer.timeScale;
}"""
_SEEK_JS = """t => {
    if (viewer.animator.duration) viewer.animator.seek(t * viewer.animator.mixer.timeScale);
    viewer.render();
}"""


def checked_size(size: npt.ArrayLike) -> tuple[int, int]:
    """Check the width and height of a film; video formats require even numbers."""
    width, height = (
        int(n) if n % 2.0 == 0.0 else 0 for n in as_array("size", size, (2,), "pixels")
    )
    if not (_MIN_PIXELS <= width <= _MAX_PIXELS and _MIN_PIXELS <= height <= _MAX_PIXELS):
        raise InputError(
            f"size is {short_repr(size)}; width and height must be even numbers of pixels from "
            f"{_MIN_PIXELS} to {_MAX_PIXELS}."
        )
    return width, height


def capture(page: str, target: Path, size: tuple[int, int]) -> None:
    """Write the recording in a page as .mp4 or .gif, or its first picture as .png."""
    # the new file is created first, so that `OSError` is raised now instead of after the work;
    # playwright refuses a thread with an event loop, such as a notebook's
    with whole_file(target, keep_link=True) as part, ThreadPoolExecutor(1) as thread:
        thread.submit(_capture, page, part, target.suffix.lower(), size).result()


def _capture(page: str, target: Path, kind: str, size: tuple[int, int]) -> None:
    """Write a file of a kind such as ".png", in a thread without an event loop."""
    # closed here, whatever happens: a browser can only be ended by the thread that started it
    with closing(_frames(page, size, FRAME_RATES[kind])) as pictures:
        if kind == ".png":
            next(pictures).save(target, "png")
        elif kind == ".gif":
            _write_gif(target, pictures)
        else:
            _write_mp4(target, pictures, size)


def _frames(page: str, size: tuple[int, int], rate: int) -> Generator[Image, None, None]:
    """Yield the recording at `rate` pictures per second of film, or only the first picture."""
    try:
        from PIL import Image
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise MissingDependencyError(
            f"No image or film can be made: {error.name} is not installed. {_REQUIREMENTS}"
        ) from None
    path = browser_path()
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder, "scene.html")
        file.write_text(page, encoding="utf-8")
        try:
            browser = playwright.chromium.launch(executable_path=path, args=_FLAGS)
        except Error as error:
            raise ViewerError(
                f"No browser could be started ({str(error).splitlines()[0]}), so no image or film "
                f"can be made. {_REQUIREMENTS}"
            ) from None
        with browser:
            window = browser.new_page(viewport={"width": size[0], "height": size[1]})
            window.add_init_script("window.isFilmed = true")  # sharply; see renderer.js
            window.goto(file.as_uri())
            window.wait_for_function(_IS_DRAWN, timeout=_TIMEOUT_MS)
            duration = window.evaluate(_PREPARE_JS)
            if rate and duration > _MAX_DURATION:
                raise ViewerError(
                    f"The film would last {duration:.0f} s; the limit is {_MAX_DURATION:g} s. "
                    f"Play a shorter rollout, or play it faster."
                )
            times = np.arange(0.0, duration + 1e-9, 1.0 / rate) if rate else np.zeros(1)
            for t in tqdm(times, desc="film", unit="picture", leave=False, disable=not rate):
                window.evaluate(_SEEK_JS, float(t))
                yield Image.open(io.BytesIO(window.screenshot())).convert("RGB")


def _write_gif(target: Path, pictures: Iterator[Image]) -> None:
    """Write pictures as an animated GIF with one palette."""
    from PIL import Image
    from PIL.Image import Dither, Quantize

    none = Dither.NONE
    # one palette for all, since separate palettes flicker; the octree keeps the colours of small
    # things, such as arrows
    first = next(pictures)
    # objects that appear later need their colours too, lit and in shade
    shades = [
        tuple(round(255 * shade * part) for part in colour)
        for _, colour, _ in LEGEND
        for shade in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    ]
    width, height = first.size
    samples = Image.new("RGB", (width, height + len(shades)))
    samples.paste(first)
    for i, shade in enumerate(shades):
        samples.paste(shade, (0, height + i, width, height + i + 1))
    palette = samples.quantize(method=Quantize.FASTOCTREE, dither=none)
    first = first.quantize(palette=palette, dither=none)
    rest = (picture.quantize(palette=palette, dither=none) for picture in pictures)
    duration = 1000 // FRAME_RATES[".gif"]
    first.save(target, "gif", save_all=True, append_images=rest, duration=duration, loop=0)


def _write_mp4(target: Path, pictures: Iterator[Image], size: tuple[int, int]) -> None:
    """Write pictures as an H.264 film."""
    try:
        import av
    except ImportError as error:
        raise MissingDependencyError(
            f"No image or film can be made: {error.name} is not installed. {_REQUIREMENTS}"
        ) from None
    with av.open(str(target), "w", format="mp4", options={"movflags": "faststart"}) as film:
        stream = film.add_stream(
            "libx264", rate=Fraction(FRAME_RATES[".mp4"]), options={"crf": "20"}
        )
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"  # which browsers and presentation programs can play
        for picture in pictures:
            film.mux(stream.encode(av.VideoFrame.from_image(picture)))
        film.mux(stream.encode())
