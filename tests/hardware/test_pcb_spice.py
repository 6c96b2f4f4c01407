"""The circuit simulations: every figure within its limits (with ngspice), and how decks are read (everywhere)."""

import dataclasses
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from hardware.pcb.checks import suite
from hardware.pcb.checks.results import CheckStatus
from hardware.pcb.circuit.design import build
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.outputs import generated_files
from hardware.pcb.proof.mutants import BoardMutant, apply
from hardware.pcb.spice import run
from hardware.pcb.spice.deck import Deck, limits
from hardware.pcb.spice.decks import decks
from hardware.pcb.spice.netlist import circuit as elements
from hardware.pcb.spice.netlist import node
from hardware.pcb.spice.page import page_text, shown
from hardware.pcb.spice.signal_decks import signal_decks
from hardware.pcb.spice.supply_decks import supply_decks
from simbase.errors import MissingDependencyError, one_line

needs_ngspice = pytest.mark.skipif(
    not run.is_installed(), reason="ngspice is not installed: the circuits are not simulated (hint: make board)"
)
DECKS = {deck.name: deck for deck in decks()}


#: A deck of two measures and two traces.
SMALL = Deck(
    name="small", title="Small", circuit="R1 a 0 1k\n.op", measures=("tran low", "tran high"),
    limits=limits(("low", -1.0, 1.0, "V", "least"), ("high", 2.0, 2.5, "V", "most")),
    traces=(("v(a)", "a"), ("v(b)", "b")), x_label="s", y_label="V", cannot_say="all else",
)  # fmt: skip


#: More than is shown of what ngspice says, no part of it like another.
WORDS = "".join(f"{number}." for number in range(1000, 1200))


@pytest.fixture
def answering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Have a script in ngspice's place that runs some lines of a shell, in the folder of the call."""

    def put(lines: str) -> None:
        script = tmp_path / "ngspice"
        script.write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
        script.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")

    return put


def test_figures_and_traces_are_what_ngspice_writes(answering: Callable[[str], None]) -> None:
    answering(
        'test "$1" = -b && grep -q "^meas tran high$" "$2" || exit 1\n'
        'grep -q "^wrdata .*/traces.txt v(a) v(b)$" "$2" || exit 1\n'
        "echo 'low                 =  -1.000000e+00 at=  2.0'\necho 'high = 2.6'\n"
        "printf '0 1 0 2\\n0.5 3 0.5 4\\n' > traces.txt"
    )
    found = run.simulate(SMALL)
    assert found.figures == {"low": -1.0, "high": 2.6}
    assert found.columns == [[0.0, 0.5], [1.0, 3.0], [2.0, 4.0]]
    assert [(limit.measure, value, good) for limit, value, good in found.verdicts()] == [
        ("low", -1.0, True),
        ("high", 2.6, False),
    ]


@pytest.mark.parametrize(
    ("lines", "lacks"),
    [
        ("echo 'low = 0.5'; echo > traces.txt", "high"),
        ("echo > traces.txt", "low, high"),
        ("echo 'low = 0.5'; echo 'high = 2.1'", "the traces"),
    ],
)
def test_what_ngspice_does_not_give_is_named_with_its_last_words(
    answering: Callable[[str], None], lines: str, lacks: str
) -> None:
    answering(f"{lines}\necho '{WORDS}' >&2")
    with pytest.raises(run.SimulationError) as raised:
        run.simulate(SMALL)
    assert str(raised.value) == one_line(f"small: no figure for {lacks}\n{WORDS[-599:]}\n")


@needs_ngspice
@pytest.mark.parametrize("name", DECKS)
def test_every_figure_is_within_its_limits_and_shown_on_the_page(name: str) -> None:
    result = run.simulate(DECKS[name])
    figures = page_figures()[name]
    for limit, value, _ in result.verdicts():
        near = pytest.approx(value, rel=0.02, abs=1e-3 * (limit.high - limit.low))
        assert figures[limit.measure] == near, (name, limit.measure)
    outside = [f"{limit.measure} {value:g} {limit.unit}" for limit, value, good in result.verdicts() if not good]
    assert outside == []
    assert all(len(column) == len(result.columns[0]) > 10 for column in result.columns)


@needs_ngspice
def test_a_wrong_reset_transistor_would_be_noticed() -> None:
    # The thesis's resistor in the emitter: EN no longer gets below the threshold.
    deck = DECKS["reset"]
    circuit = deck.circuit.replace("n_rst_base 0 BC817", "n_rst_base e1 BC817\nRe1 e1 0 2.2k")
    assert circuit != deck.circuit
    weak = dataclasses.replace(deck, circuit=circuit, measures=deck.measures[:1], limits=deck.limits[:1])
    assert [good for *_, good in run.simulate(weak).verdicts()] == [False]


@needs_ngspice
def test_a_reversed_input_without_its_diode_would_be_noticed() -> None:
    deck = DECKS["reverse"]
    bridged = dataclasses.replace(
        deck, circuit=deck.circuit.replace("DD1 n_vin_fused n_p12v B340A", "R9 n_vin_fused n_p12v 0.01")
    )
    failed = {limit.measure for limit, _, good in run.simulate(bridged).verdicts() if not good}
    assert {"wrong", "leak"} <= failed


def test_every_deck_says_what_it_cannot_say_and_limits_what_it_measures() -> None:
    assert len(DECKS) == len(decks()) == 19
    for deck in DECKS.values():
        assert deck.cannot_say.endswith("."), deck.name
        measured = {measure.split()[1] for measure in deck.measures}
        assert {limit.measure for limit in deck.limits} == measured, deck.name
        assert not {expression for expression, _ in deck.traces} & {f"v({name})" for name in measured}, deck.name
        assert all(limit.low < limit.high for limit in deck.limits), deck.name


def test_a_deck_is_written_with_its_measures_and_traces(tmp_path) -> None:
    text = run.deck_text(DECKS["reset"], tmp_path / "traces.txt")
    assert text.startswith("* Reset: level at the ESP32's EN\n")
    assert "meas tran en_low find v(n_esp_en) at=39m\n" in text
    assert f"wrdata {tmp_path}/traces.txt v(pin) v(n_esp_en) v(en2)\nquit\n.endc\n.end\n" in text


DECK = Deck(name="d", title="t", circuit="R1 a 0 1", measures=("dc top max v(a)",), x_label="x", y_label="y",
            limits=limits(("top", 1.0, 2.0, "V", "m")), traces=(("v(a)", "a"),), cannot_say="Nothing.")  # fmt: skip


@pytest.fixture
def fake_ngspice(tmp_path, monkeypatch):
    """Put a stand-in in ngspice's place, which prints the given words and writes two rows of traces."""

    def install(words: str, traces: str = "0 1.5\\n1 1.75\\n") -> None:
        program = tmp_path / "ngspice"
        program.write_text(
            f"#!{sys.executable}\nimport sys, re\ndeck = open(sys.argv[2]).read()\nprint({words!r})\n"
            f"open(re.search('wrdata (\\\\S+)', deck)[1], 'w').write('{traces}')\n",
            encoding="utf-8",
        )
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(tmp_path))

    return install


def test_figures_and_traces_are_read_back(fake_ngspice) -> None:
    fake_ngspice("top                 =  1.75e+00 at= 1")
    result = run.simulate(DECK)
    assert (result.figures, result.columns) == ({"top": 1.75}, [[0.0, 1.0], [1.5, 1.75]])
    assert [good for *_, good in result.verdicts()] == [True]


def test_a_missing_figure_quotes_the_simulator(fake_ngspice) -> None:
    fake_ngspice("Error: no such vector")
    with pytest.raises(run.SimulationError, match="d: no figure for top Error: no such vector"):
        run.simulate(DECK)


def test_checks_of_decks_pass_and_fail_by_their_limits(fake_ngspice, monkeypatch) -> None:
    fake_ngspice("top = 1.75")
    low = dataclasses.replace(DECK, limits=limits(("top", 1.8, 2.0, "V", "m")))
    monkeypatch.setattr(suite, "decks", lambda: (DECK, low))
    results = suite.simulations()
    assert [result.verdict for result in results] == [CheckStatus.GOOD, CheckStatus.BAD]
    assert results[0].detail == "top 1.75 V"


def test_without_ngspice_it_is_said_and_skipped(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingDependencyError, match="not installed"):
        run.simulate(DECK)
    (result,) = suite.simulations()
    assert result.verdict is CheckStatus.SKIPPED


def test_a_plot_is_drawn_for_each_deck(fake_ngspice, monkeypatch, tmp_path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from hardware.pcb.outputs import pictures

    fake_ngspice("top = 1.75")
    monkeypatch.setattr(generated_files, "PICTURES", tmp_path / "pictures")
    file = pictures.plot(run.simulate(DECK))
    assert file.name == "sim-d.png"
    assert file.read_bytes().startswith(b"\x89PNG")


@cache
def page_figures() -> dict[str, dict[str, float]]:
    """Return the figures that the committed page shows, by deck and measure."""
    sections = generated_files.SIMULATION_PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    figures = {}
    for deck, section in zip(DECKS.values(), sections, strict=True):
        rows = [line.split(" | ")[1].split()[0] for line in section.splitlines() if line.startswith("| ")][2:]
        figures[deck.name] = {limit.measure: float(row) for limit, row in zip(deck.limits, rows, strict=True)}
    return figures


def test_the_page_is_what_the_decks_give_with_its_own_figures() -> None:
    assert page_text(decks(), page_figures()) == generated_files.SIMULATION_PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(("value", "text"), [(0.0, "0"), (4.999, "5"), (119.44, "119"), (2.4e-05, "2.40e-05")])
def test_figures_have_three_digits(value: float, text: str) -> None:
    assert shown(value) == text


def wrong(edit: str) -> BoardDesign:
    """Return rev-b with one edit of proof/mutants.py."""
    return apply(build(), BoardMutant(rule="x", name="x", edits=(edit,)))


#: Edits of the circuit, the deck that must notice it, and one figure that leaves its limits.
FELT = (
    ("swap J3.2 J3.3", "rs232", "space"), ("swap U5.11 U5.12", "rs232", "space"),
    ("swap D1.K D1.A", "reverse", "right"), ("swap D2.K D2.A", "reverse", "right"),
    ("swap D5.K D5.A", "startup-buck", "esp"), ("net J3.4 -", "rs232", "dtr_low"),
    ("swap R1.2 R2.2", "wires", "dd1"), ("net Q1.2 +3V3", "reset", "en_low"), ("drop R73", "boot", "din_down"),
    ("drop Q4", "stop", "stop_line"), ("drop Q2", "stop", "stop_en"), ("drop R79", "stop", "stop_en"),
    ("drop R78", "stop", "stop_line"), ("drop R80", "stop", "stop_en"),
    ("value R60 4k7", "boot", "mode_low"), ("drop R33", "boot", "dd3_low"), ("swap D3.K D3.A", "bank", "good"),
)  # fmt: skip


@needs_ngspice
@pytest.mark.parametrize(("edit", "name", "measure"), FELT)
def test_the_decks_are_built_from_the_netlist_and_feel_a_wrong_circuit(edit: str, name: str, measure: str) -> None:
    design = wrong(edit)
    deck = next(
        deck for deck in (*signal_decks(design), *supply_decks(design, build("lm317"), design)) if deck.name == name
    )
    alone = dataclasses.replace(
        deck,
        measures=tuple(line for line in deck.measures if line.split()[1] == measure),
        limits=tuple(limit for limit in deck.limits if limit.measure == measure),
    )
    assert [good for *_, good in run.simulate(alone).verdicts()] == [False]


def test_every_part_of_the_board_is_an_element_with_its_own_nets_and_value() -> None:
    lines = {line.split()[0]: line.split()[1:] for line in elements(build()).splitlines()}
    assert lines["RR12"] == ["n_encoder2_s1_bp", "n_encoder2_s1", "680"]
    assert lines["DD1"] == ["n_vin_fused", "n_p12v", "B340A"]
    assert lines["QQ1"] == ["n_esp_en", "n_rst_base", "0", "BC817"]
    silent = {"BLUEPILL", "ESP32_D1_MINI", "CONN2", "CONN3", "CONN24", "DE9", "TESTPOINT", "HOLE", "SWITCH"}
    for part in build().components:
        assert (part.part.symbol in silent) != any(key[1:] == part.ref for key in lines), part.ref
    assert node(build(), "U2.IO17") == "n_esp_tx"
    assert node(build(), "J3.7") == "n_open_j3_7"
    assert node(wrong("drop R62"), "R62.1") == "n_open_r62_1"
