"""Damaged files of every format: read, or refused in one line that names the file; `tools/fuzz/files.py` damages."""

import runpy
from pathlib import Path

import pytest

FUZZ = runpy.run_path(str(Path(__file__).resolve().parents[3] / "tools" / "fuzz" / "files.py"))


@pytest.mark.parametrize("name", FUZZ["FORMATS"])
def test_a_damaged_file_is_read_or_refused_in_one_line(name: str) -> None:
    assert FUZZ["fuzz"](name, 30, 1) == []


@pytest.mark.parametrize("name", FUZZ["FORMATS"])
def test_what_is_damaged_was_right(name: str, tmp_path: Path) -> None:
    rng = FUZZ["random"].Random(0)
    for seed in FUZZ["FORMATS"][name].seeds():
        for file, data in seed.beside.items():
            (tmp_path / file).write_bytes(data)
        assert FUZZ["run_case"](name, seed, seed.data, tmp_path, rng)


def test_the_fuzzer_tells_a_hang_and_a_bug_by_case_and_seed() -> None:
    def hang(_path: Path, _rng: object) -> None:
        while True:
            pass

    def fail(_path: Path, _rng: object) -> None:
        raise ZeroDivisionError

    form = FUZZ["FORMATS"]["flash"]
    formats = FUZZ["fuzz"].__globals__
    before = formats["FORMATS"], formats["LIMIT_S"]
    try:
        formats["LIMIT_S"] = 0.05
        formats["FORMATS"] = {"flash": FUZZ["FileFormat"](form.seeds, form.syntax, hang)}
        assert "flash: case 0 of seed 3: not done within" in FUZZ["fuzz"]("flash", 1, 3)[0]
        formats["FORMATS"] = {"flash": FUZZ["FileFormat"](form.seeds, form.syntax, fail)}
        assert "ZeroDivisionError" in FUZZ["fuzz"]("flash", 1, 3)[0]
    finally:
        formats["FORMATS"], formats["LIMIT_S"] = before


@pytest.mark.soak
@pytest.mark.parametrize("name", FUZZ["FORMATS"])
def test_ten_thousand_damaged_files_are_read_or_refused(name: str) -> None:
    assert FUZZ["fuzz"](name, 10_000, 2) == []
