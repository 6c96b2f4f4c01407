"""A run as pictures: what is asked for, what is refused in a line, and what a browser without a window draws."""

import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from p2os.cli.captures import headless, render
from p2os.cli.main import run as p2os
from p2os.errors import RunFailedError
from simbase.errors import UsageError
from simbase.timing import NS_PER_S

CAPTURE = Path(__file__).resolve().parents[2] / "golden" / "captures" / "aria_p2de.jsonl"


@pytest.mark.parametrize(("words", "says"), [
    (["-o", "x.bmp"], "is no picture that is drawn"), (["--size", "10x10"], "no size"), (["--size", "axb"], "no size"),
    (["--view", "nothing"], "no view 'nothing'"),
    (["-o", "x.svg", "--view", "packets"], "no one drawing of lines"),
    (["-o", "x.gif", "--from", "9s", "--to", "1s"], "behind its beginning"),
    (["-o", "x.gif", "--fps", "100000"], "more than 1500"),
])  # fmt: skip
def test_what_cannot_be_drawn_is_said(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("PIL")
    assert p2os(["render", str(CAPTURE), *words]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert "hint: " in said


def nothing_for_this_machine() -> str:
    raise RuntimeError("No ffmpeg exe could be found.")


def test_what_is_not_installed_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    assert p2os(["render", str(CAPTURE), "-o", str(tmp_path / "x.png")]) == 2
    assert "needs Chromium or Chrome" in capsys.readouterr().err
    modules = __import__("sys").modules
    for package in (None, SimpleNamespace(get_ffmpeg_exe=nothing_for_this_machine)):
        monkeypatch.setitem(modules, "imageio_ffmpeg", package)
        assert p2os(["render", str(CAPTURE), "-o", str(tmp_path / "x.mp4")]) == 2
        said = capsys.readouterr().err
        assert "an MP4 needs ffmpeg" in said
        assert "pip install imageio-ffmpeg" in said
    monkeypatch.setitem(modules, "PIL", None)
    assert p2os(["render", str(CAPTURE), "-o", str(tmp_path / "x.gif")]) == 2
    assert "a GIF needs Pillow" in capsys.readouterr().err


def test_a_browser_that_does_not_answer_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "BROWSERS", ("true",))  # it ends at once
    with pytest.raises(RunFailedError, match="does not answer"), headless.headless_page():
        pass


def test_a_film_has_a_picture_at_each_of_its_times() -> None:
    film = render._film(NS_PER_S, 3 * NS_PER_S, speed=2.0, fps=4.0)
    assert [at / NS_PER_S for at in film.times] == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert len(render._film(0, render.MOST_FRAMES - 1, speed=1.0, fps=NS_PER_S).times) == render.MOST_FRAMES


@pytest.mark.parametrize("ends", [0, 3])
def test_an_mp4_is_made_by_the_ffmpeg_of_a_package_where_the_machine_has_none(
    ends: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = tmp_path / "ffmpeg-of-the-package"
    program.write_text(
        '#!/bin/sh\nfor out; do :; done\ncat > "$out"\n' if not ends else "#!/bin/sh\necho no room >&2\nexit 3\n"
    )
    program.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    package = SimpleNamespace(get_ffmpeg_exe=lambda: str(program))
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", package)
    pictures = (bytes([number]) * 100_000 for number in range(5))
    out = tmp_path / "run.mp4"
    if ends:
        with pytest.raises(UsageError, match="ffmpeg: no room"):
            render._write_mp4(out, pictures, 10.0)
        return
    render._write_mp4(out, pictures, 10.0)
    assert out.read_bytes() == b"".join(bytes([number]) * 100_000 for number in range(5))


def test_a_film_whose_drawing_fails_ends_ffmpeg(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def pictures() -> Iterator[bytes]:
        yield b"one"
        raise RunFailedError("the browser does not answer")

    monkeypatch.setattr(render, "_ffmpeg", lambda: "cat")
    with pytest.raises(RunFailedError, match="does not answer"):
        render._write_mp4(tmp_path / "run.mp4", pictures(), 10.0)


@pytest.mark.slow
def test_the_page_draws_itself_as_png_svg_and_gif(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    if not any(map(shutil.which, headless.BROWSERS)):
        pytest.skip("no browser is installed")
    files = {ending: tmp_path / f"run.{ending}" for ending in ("png", "svg", "gif")}
    assert p2os(["render", str(CAPTURE), "-o", str(files["png"]), "--size", "900x600", "--at", "1s"]) == 0
    assert p2os(["render", str(CAPTURE), "-o", str(files["svg"]), "--size", "900x600"]) == 0
    film = ["-o", str(files["gif"]), "--view", "plan", "--size", "400x300", "--to", "2s", "--fps", "2"]
    assert p2os(["render", str(CAPTURE), *film]) == 0
    shown = image.open(io.BytesIO(files["png"].read_bytes()))
    assert shown.size == (900, 600)
    assert len(shown.convert("RGB").getcolors(1 << 20)) > 50
    drawn = files["svg"].read_text()
    assert drawn.startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    assert drawn.count("<path") > 10
    assert drawn.count("<g ") == drawn.count("</g>")
    moving = image.open(files["gif"])
    assert (moving.size, moving.n_frames) == ((400, 300), 5)
