"""Stand-ins for KiCad: they answer as kicad-cli and pcbnew do, so that our side is tested where KiCad is absent."""

import os
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

#: Answers to `kicad-cli`: the file that the option -o names gets the text of the environment's FAKE_ANSWER.
_COMMAND = """
    #!{python}
    import os, sys, pathlib
    words = sys.argv[1:]
    if words == ["version"]:
        print(os.environ["FAKE_VERSION"])
    elif os.environ.get("FAKE_ERROR"):
        sys.exit(os.environ["FAKE_ERROR"])
    else:
        target = pathlib.Path(words[words.index("-o") + 1])
        if words[1:3] == ["export", "gerbers"]:
            target = target / "board-F_Cu.gtl"
        elif words[1:3] == ["export", "drill"]:
            target = target / "board-PTH.drl"
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(os.environ["FAKE_ANSWER"])
"""
#: The part of KiCad's Python module that pours.py calls: "fills" each zone with the polygon it was drawn with.
_MODULE = """
    import os, pathlib
    class Board:
        def __init__(self, path): self.text = pathlib.Path(path).read_text()
        def Zones(self): return []
        def Save(self, path):
            if not os.environ.get("FAKE_ERROR"):
                pathlib.Path(path).write_text(os.environ.get("FAKE_ANSWER", self.text))
    LoadBoard = Board
    class ZONE_FILLER:
        def __init__(self, board): pass
        def Fill(self, zones): pass
"""


@pytest.fixture
def fake_kicad(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put stand-ins in KiCad's place; returns a function that sets what they answer."""
    from hardware.pcb.outputs import kicad_cli, pours

    folder = tmp_path / "bin"
    folder.mkdir()
    command = folder / "kicad-cli"
    command.write_text(textwrap.dedent(_COMMAND).lstrip().format(python=sys.executable), encoding="utf-8")
    command.chmod(0o755)
    (folder / "pcbnew.py").write_text(textwrap.dedent(_MODULE), encoding="utf-8")
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.setattr(pours, "_PYTHONS", (sys.executable,))

    def answer(text: str = "", *, version: str = "9.0.8", error: str = "") -> None:
        monkeypatch.setenv("FAKE_ANSWER", text)
        monkeypatch.setenv("FAKE_VERSION", version)
        monkeypatch.setenv("FAKE_ERROR", error)
        kicad_cli.version.cache_clear()

    answer()
    yield answer
    kicad_cli.version.cache_clear()
