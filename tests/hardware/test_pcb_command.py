"""`python -m hardware.pcb`: what each verb says, writes and returns."""

from pathlib import Path

import pytest

from hardware.pcb import __main__ as command
from hardware.pcb.checks import suite
from hardware.pcb.checks.results import CheckStatus, judged, skipped
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.layout.routing import RoutingError
from hardware.pcb.outputs import generated_files, kicad_cli
from hardware.pcb.spice.deck import Deck, limits
from hardware.pcb.spice.run import DeckResult

RESULTS = [judged("ERC", "rev-b", True, "0 findings"), skipped("DRC", "rev-b", "KiCad 9 is not installed")]


def test_check_prints_the_table_and_forgives_what_is_not_installed(capsys, monkeypatch) -> None:
    monkeypatch.setattr(suite, "run_all", lambda: RESULTS)
    assert command.main(["check"]) == 0
    assert capsys.readouterr().out == (
        "ok       ERC  rev-b  0 findings\nskipped  DRC  rev-b  KiCad 9 is not installed\n1 ok, 0 failed, 1 skipped\n"
    )
    assert command.main(["check", "--strict"]) == 1


def test_check_fails_where_a_check_fails(monkeypatch) -> None:
    monkeypatch.setattr(suite, "run_all", lambda: [judged("ERC", "rev-b", False, "1: error")])
    assert command.main(["check"]) == 1


def test_run_all_joins_the_three_kinds(monkeypatch) -> None:
    monkeypatch.setattr(suite, "plain", lambda: RESULTS[:1])
    monkeypatch.setattr(suite.kicad_checks, "with_kicad", lambda: RESULTS[1:])
    monkeypatch.setattr(suite, "simulations", list)
    assert suite.run_all() == RESULTS


def test_build_without_kicad_renews_the_sources_and_says_what_stays(capsys, monkeypatch) -> None:
    monkeypatch.setattr(generated_files, "write_sources", lambda: ["rev-b/rev-b.kicad_pcb"])
    monkeypatch.setattr(kicad_cli, "version", lambda: None)
    assert command.main(["build"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("1 generated files renewed\nKiCad 9 is not installed: gerbers stay")


def test_build_with_kicad_writes_the_archives(capsys, monkeypatch, tmp_path) -> None:
    for variant in VARIANTS:
        (tmp_path / variant).mkdir()
    monkeypatch.setattr(generated_files, "GENERATED", tmp_path)
    monkeypatch.setattr(generated_files, "write_sources", list)
    monkeypatch.setattr(kicad_cli, "version", lambda: "9.0.8")
    monkeypatch.setattr(
        generated_files, "filled_project", lambda variant, folder: Path(folder) / f"{variant}.kicad_pcb"
    )
    monkeypatch.setattr(generated_files, "fabrication_files", lambda *_: {"a.gbr": "one"})
    monkeypatch.setattr(kicad_cli, "reports", lambda variant, *_: {f"{variant}-erc.rpt": "0"})
    monkeypatch.setattr(kicad_cli, "step", lambda _, file: file.write_text("STEP", encoding="utf-8"))
    assert command.main(["build"]) == 0
    assert (tmp_path / "rev-b" / "rev-b.step").exists()
    assert "rev-b-gerbers.zip: 1 files" in capsys.readouterr().out
    assert (tmp_path / "rev-c" / "rev-c-erc.rpt").read_text(encoding="utf-8") == "0"
    assert (tmp_path / "lm317" / "lm317-gerbers.zip").read_bytes() == generated_files.archive({"a.gbr": "one"})


def test_route_and_stitch_write_their_data(capsys, monkeypatch, tmp_path) -> None:
    for folder in ("routes", "stitches"):
        (tmp_path / folder).mkdir()
    monkeypatch.setattr(command, "HERE", tmp_path)
    monkeypatch.setattr(command, "run_router", lambda _: "# input 0\nT GND\nT GND\nV GND\n")
    monkeypatch.setattr(command, "stitches_of", lambda _: "1,2\n3,4\n")
    assert command.main(["route", "rev-b"]) == 0
    assert command.main(["stitch"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out == ["routes/rev-b.txt: 2 tracks, 1 vias", "stitches/rev-b.txt: 2 stitching vias",
                   "stitches/lm317.txt: 2 stitching vias", "stitches/rev-c.txt: 2 stitching vias"]  # fmt: skip
    assert (tmp_path / "stitches" / "lm317.txt").read_text(encoding="utf-8") == "1,2\n3,4\n"


def test_simulate_prints_figures_and_renews_the_page(capsys, monkeypatch, tmp_path) -> None:
    deck = Deck(name="d", title="Deck", circuit="", measures=(), limits=limits(("top", 1.0, 2.0, "V", "highest")),
                traces=(), x_label="", y_label="", cannot_say="Nothing.")  # fmt: skip
    monkeypatch.setattr(command, "is_installed", lambda: True)
    monkeypatch.setattr(command, "decks", lambda: (deck,))
    monkeypatch.setattr(command, "simulate", lambda _: DeckResult(deck=deck, figures={"top": 2.5}, columns=[]))
    monkeypatch.setattr(generated_files, "SIMULATION_PAGE", tmp_path / "page.md")
    assert command.main(["simulate"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "FAIL  simulation  d  top 2.5 V", "0 ok, 1 failed, 0 skipped", "page.md: 1 simulations",
    ]  # fmt: skip
    assert "| highest | 2.5 V | 1 … 2 |" in (tmp_path / "page.md").read_text(encoding="utf-8")


def test_simulate_without_ngspice_says_so(capsys, monkeypatch) -> None:
    monkeypatch.setattr(command, "is_installed", lambda: False)
    monkeypatch.setattr(suite, "simulations", lambda: [skipped("simulation", "all", "ngspice is not installed")])
    assert command.main(["simulate"]) == 0
    assert "ngspice is not installed" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["route", "rev-z"], ["stitch", "nonsense"]])
def test_a_variant_that_is_unknown_is_one_line(words: list[str], capsys) -> None:
    assert command.main(words) == 1
    assert "is unknown (one of rev-b, lm317, rev-c)" in capsys.readouterr().err


def test_an_error_is_one_line_and_no_traceback(capsys, monkeypatch) -> None:
    def broken() -> list[str]:
        raise RoutingError("routes of rev-b were made for another placement")

    monkeypatch.setattr(generated_files, "write_sources", broken)
    assert command.main(["build"]) == 1
    assert capsys.readouterr().err == "board: routes of rev-b were made for another placement\n"


def test_a_missing_verb_is_wrong_usage() -> None:
    with pytest.raises(SystemExit) as stop:
        command.main([])
    assert stop.value.code == 2


def test_verdicts_are_the_words_of_the_table() -> None:
    assert [str(verdict) for verdict in CheckStatus] == ["ok", "FAIL", "skipped"]
