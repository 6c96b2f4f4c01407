"""`p2os render`: a run as a picture, or as a moving one, drawn by the page itself in a browser without a window."""

import contextlib
import io
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, cast

import typer

from p2os.cli.captures.headless import HeadlessPage, headless_page
from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.errors import RunFailedError
from p2os.view.page import page_of
from p2os.view.targets import target_of
from simbase.errors import MissingDependencyError, UsageError
from simbase.files import writing
from simbase.timing import NS_PER_S, Nanos
from simbase.units import FACTOR, TIME

HELP = """Draw a run or capture as a picture or film.

The page of `p2os view` draws it in a Chromium or Chrome without a window. The
file's ending selects the format: png, svg (the plan), gif (needs Pillow) or mp4
(needs ffmpeg).

\b
Examples:
  p2os render runs/dodge-001                         dodge-001.png, at its end
  p2os render runs/dodge-001 -o run.gif --view plan  the plan, from start to end
  p2os render runs/dodge-001 -o at.png --at 2.5s     the whole page at a time
  p2os render runs/dodge-001 -o run.mp4 --from 1s --to 6s --speed 2
"""
VIEWS = ("plan", "scene", "logic", "plots", "packets", "consoles", "events", "goals", "states", "report")
#: Those that are one drawing of lines, which an SVG can hold; and pictures that do not move.
DRAWINGS, STILLS = ("plan",), (".png", ".svg")
#: chosen: a film of more is no film, and each is drawn in some tenths of a second.
MOST_FRAMES = 1500
_LEAST_PX, _MOST_PX = 200, 4000
#: What the page is when it has drawn all that it shows: two frames after the last time that it was changed.
_DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
_ALONE = """(() => {
  const view = document.querySelector('.view-%s');
  if (!view) return false;
  document.body.append(view);
  view.style.cssText = 'position: fixed; inset: 0; z-index: 99; width: 100vw; height: 100vh';
  return true;
})()"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is drawn: times of the run, and how many pictures a second."""

    times: tuple[Nanos, ...]
    pace_hz: float


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("render", help=HELP, rich_help_panel=BENCH)(render)


def render(
    target: Annotated[str, typer.Argument(help="Run folder or capture.", metavar="RUN")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The picture: .png, .svg, .gif, .mp4.", metavar="FILE")
    ] = None,
    at_ns: Annotated[Nanos | None, option(TIME, "--at", purpose="Of a picture: when; default the end.")] = None,
    from_ns: Annotated[Nanos | None, option(TIME, "--from", purpose="Of a film: its beginning.")] = None,
    to_ns: Annotated[Nanos | None, option(TIME, "--to", purpose="Of a film: its end.")] = None,
    speed: Annotated[
        float, option(FACTOR, "--speed", purpose="Of a film: how fast the run goes.", shown="1", above_zero=True)
    ] = 1.0,
    fps: Annotated[
        float, option(FACTOR, "--fps", purpose="Of a film: pictures a second.", shown="10", above_zero=True)
    ] = 10.0,
    view: Annotated[str, typer.Option(help="One view alone.", metavar="|".join(VIEWS))] = "",
    layout: Annotated[str, typer.Option(help="Of the whole page.", metavar="student|firmware|lab")] = "student",
    size: Annotated[str, typer.Option(help="Pixels.", metavar="WIDTHxHEIGHT")] = "1400x900",
    dark: Annotated[bool, typer.Option("--dark", help="In dark colours.")] = False,
) -> None:
    """Draw a run."""
    path = out or Path(f"{Path(target).resolve().name}.png")
    write = _writer_of(path)
    width, height = _size_of(size)
    view = view or ("plan" if path.suffix == ".svg" else "")
    if view and view not in VIEWS:
        raise UsageError(f"there is no view {view!r}", hint=", ".join(VIEWS))
    if path.suffix == ".svg" and view not in DRAWINGS:
        raise UsageError(f"{view} is no one drawing of lines", hint=f"--view {' or '.join(DRAWINGS)}; or a .png")
    recording = target_of(target).source.recording
    start, end = recording.header.start_ns, recording.header.end_ns
    if path.suffix in STILLS:
        wanted = end if at_ns is None else at_ns
        film = Film(times=(max(start, min(end, wanted)),), pace_hz=fps)
    else:
        film = _film(max(start, from_ns or start), min(end, end if to_ns is None else to_ns), speed, fps)
    with TemporaryDirectory(prefix="p2os-render-") as folder, headless_page() as page:
        document = Path(folder) / "page.html"
        document.write_text(page_of(recording), encoding="utf-8")
        fragment = f"layout={layout}{f'&view={view}' if view else ''}"
        page.open(f"{document.as_uri()}#{fragment}", width, height, is_dark=dark)
        page.wait_for("window.p2osPage && window.p2osPage.app.store.version.value > 0")
        page.evaluate(_DRAWN)
        if view and not page.evaluate(_ALONE % view):
            raise UsageError(f"this run has no {view}", hint="another --view")
        with writing(path.parent):
            if path.suffix == ".svg":
                page.evaluate(f"window.p2osPage.app.clock.seek({film.times[0]}); {_DRAWN}")
                _write_svg(page, path, view)
            else:
                write(path, _pictures(page, film), film.pace_hz)
    typer.echo(f"{path}: {len(film.times)} picture{'s' if len(film.times) > 1 else ''} of {width} x {height}")


def _pictures(page: HeadlessPage, film: Film) -> Iterator[bytes]:
    for at in film.times:
        page.evaluate(f"window.p2osPage.app.clock.seek({at}); {_DRAWN}")
        yield page.picture()


def _film(start: Nanos, end: Nanos, speed: float, fps: float) -> Film:
    if end <= start:
        raise UsageError("a film ends behind its beginning", hint="--from 0s --to 5s")
    step = speed / fps * NS_PER_S
    count = int((end - start) / step) + 1
    if count > MOST_FRAMES:
        raise UsageError(f"{count} pictures are more than {MOST_FRAMES}", hint="--speed 10, or --from and --to")
    return Film(times=(*(start + round(number * step) for number in range(count)),), pace_hz=fps)


def _write_svg(page: HeadlessPage, path: Path, view: str) -> None:
    """Write a view that is one drawing, as what draws it on the screen draws it into an SVG."""
    text = page.evaluate(f"window.p2osPage.svgOf(document.querySelector('.view-{view} canvas.surface'))")
    if not isinstance(text, str):
        raise RunFailedError(f"the page has drawn no {view}")
    path.write_text(text, encoding="utf-8")


def _write_png(path: Path, pictures: Iterator[bytes], _pace_hz: float) -> None:
    path.write_bytes(next(pictures))


def _write_gif(path: Path, pictures: Iterator[bytes], pace_hz: float) -> None:
    """Write a GIF: of all pictures the colours of the last one, which has most in it, and what changes of each."""
    from PIL import Image

    found = [Image.open(io.BytesIO(data)).convert("RGB") for data in pictures]
    colours = found[-1].quantize(64)
    frames = [one.quantize(palette=colours, dither=Image.Dither.NONE) for one in found]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=round(1000 / pace_hz), loop=0,
        optimize=False, disposal=1,
    )  # fmt: skip


def _write_mp4(path: Path, pictures: Iterator[bytes], pace_hz: float) -> None:
    command = [_ffmpeg(), "-y", "-loglevel", "error", "-f", "image2pipe", "-framerate", f"{pace_hz:g}", "-i", "-",
               "-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", str(path)]  # fmt: skip
    with subprocess.Popen(  # noqa: S603 - ffmpeg with our own words
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as running:
        assert running.stdin is not None  # noqa: S101 - it is a pipe
        assert running.stderr is not None  # noqa: S101 - likewise
        try:
            with contextlib.suppress(BrokenPipeError):  # it has ended, and says why
                for picture in pictures:
                    running.stdin.write(picture)
                running.stdin.close()
        except BaseException:
            running.kill()
            with contextlib.suppress(BrokenPipeError):  # what waits in our buffer goes nowhere
                running.stdin.close()
            raise
        said = running.stderr.read().decode("utf-8", "replace").strip()
    if running.returncode:
        raise UsageError(f"ffmpeg: {said[-300:]}")


def _ffmpeg() -> str:
    """Return the program ffmpeg: this machine's, or that of the package imageio-ffmpeg.

    Raises:
        MissingDependencyError: Neither is here.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        with contextlib.suppress(ImportError, RuntimeError):  # RuntimeError: the package brings none for this machine
            found = str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    if found is None:
        hint = "apt-get install ffmpeg, or pip install imageio-ffmpeg; or a .gif"
        raise MissingDependencyError("an MP4 needs ffmpeg, which is not here", hint=hint)
    return found


_Write = Callable[[Path, Iterator[bytes], float], None]
_WRITERS: Mapping[str, _Write] = {".png": _write_png, ".svg": _write_png, ".gif": _write_gif, ".mp4": _write_mp4}


def _writer_of(path: Path) -> _Write:
    """Return what writes a file of this ending.

    Raises:
        UsageError: No picture ends so.
        MissingDependencyError: What writes it is not here.
    """
    if path.suffix not in _WRITERS:
        raise UsageError(f"{path} is no picture that is drawn", hint=f"a name that ends in {', '.join(_WRITERS)}")
    if path.suffix == ".gif":
        with contextlib.suppress(ImportError):
            import PIL.Image  # noqa: F401 - whether it is there

            return _write_gif
        raise MissingDependencyError("a GIF needs Pillow, which is not here", extra="view")
    if path.suffix == ".mp4":
        _ffmpeg()
    return _WRITERS[path.suffix]


def _size_of(text: str) -> tuple[int, int]:
    found = [int(word) for word in text.lower().split("x") if word.isdecimal()]
    if len(found) != 2 or not all(_LEAST_PX <= one <= _MOST_PX for one in found):
        raise UsageError(f"{text!r} is no size", hint=f"such as 1400x900, each from {_LEAST_PX} to {_MOST_PX}")
    return cast("tuple[int, int]", tuple(found))
