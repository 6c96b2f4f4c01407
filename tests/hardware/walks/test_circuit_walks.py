"""The board's circuit and orders, checked as they are and with faults drawn into them, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import contextlib
import dataclasses
import io
import os
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import patch

from adapter_sim.pinout import load_pinout
from hardware.case import __main__ as case_command
from hardware.pcb import __main__ as command
from hardware.pcb.checks import copper, pin_checks, results
from hardware.pcb.circuit import electrical, part_numbers
from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.circuit.netlist import BoardDesign, make
from hardware.pcb.circuit.parts import ACCESSORIES, PARTS, Part
from hardware.pcb.layout.routing import Track, load_routes
from hardware.pcb.outputs import generated_files
from hardware.pcb.proof import board_file, expected, lands, mistakes, mutants, printed
from hardware.pcb.spice import deck, decks, netlist, page, run
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

PACKAGES = ("hardware.case", "hardware.pcb", *(f"hardware.pcb.{name}" for name in
            ("checks", "circuit", "layout", "outputs", "proof", "spice")))  # fmt: skip


def circuits(draw: random.Random) -> Iterator[str]:
    """Check each variant as it is, and with other parts, pins and nets."""
    for variant in VARIANTS:
        design = build(variant)
        yield said(design.components)
        for check in electrical.all_checks(design):
            yield f"{variant} {said(check)} {check}"
        single, whole = mutants.draw(design, 7), mutants.draw_whole(design, 7)
        for mutant in draw.sample(single, 12) + draw.sample(whole, 6):
            yield f"{mutant} {said(sorted(mutant.touches()))}"
            wrong = mutants.apply(design, mutant)
            yield said([expected.differences(wrong), electrical.netlist_faults(wrong)])
        for mutant in single:
            if mutant.name.startswith("value R") or (mutant.name.startswith("drop ") and draw.random() < 0.2):
                yield f"{mutant.name} {_checked(mutants.apply(design, mutant))}"
    for action in (lambda: build("rev-z"), lambda: make("R1", "3k9", []), lambda: make("R1", "1k", {"9": None})):
        yield tried(action)
    for pins in ([("1", "A"), ("1", "B")], [("1", None)]):
        part = dataclasses.replace(make("R1", "1k", []), pins=tuple(pins))
        yield tried(lambda part=part: dataclasses.replace(build(), components=(part, make("R2", "1k", []))).nets())
        yield tried(lambda part=part: dataclasses.replace(build(), components=(part, part)))
    for board in pin_checks.BOARDS.values():
        found = pin_checks.findings(load_pinout(), board)
        yield said([[*map(str, found)], pin_checks.count_by_rule(found)])
    yield said([pin_checks.gpio(pin) for pin in ("IO0", "IO39", "EN", "HC595.1", None)])


def _checked(design: BoardDesign) -> str:
    checks = (electrical.mode_divider, electrical.logic_levels, electrical.injection, electrical.power_budget,
              electrical.supply_margins, electrical.reset_transistor, electrical.mode_button, electrical.stop_loop,
              electrical.ratings, electrical.linear_regulators)  # fmt: skip
    return said([tried(_figures_of, check, design) for check in checks])


def _figures_of(check: Callable[[BoardDesign], list[electrical.Check]], design: BoardDesign) -> list[str]:
    return [f"{one.value:.5g}{'' if one.is_good else '!'}" for one in check(design)]


#: What may stand for a group of an order number's pattern.
_CODES = {"size": ("0402", "0603", "0805", "1206", "2012", "1608", "15", "18", "21", "31", "32", "9999"),
          "ohm": ("1K", "4K7", "470R", "0R5", "1M", "R47", "20K"), "volts": ("5.0", "15", "24", "0J", "1A", "1C", "1E",
          "1V", "1H", "1J", "5", "6", "7", "8", "9", "12", "33", "120", "150", "0"), "farad": ("104", "226", "101", "470"),
          "shape": ("0242", "0211", "0311", "0102"), "amps": ("2", "3"), "poles": ("2", "3", "10"),
          "hold": ("050", "110")}  # fmt: skip


def orders(draw: random.Random) -> Iterator[str]:
    """Read order numbers, of each series with each code in its place, and hold parts against those of others."""
    bought = [part for part in (*PARTS.values(), *(row[2] for row in ACCESSORIES)) if part.bought]
    for series in part_numbers.SERIES:
        own = [
            part.mpn for part in bought if part.manufacturer == series.maker and re.fullmatch(series.pattern, part.mpn)
        ]
        for number in own:
            found = re.fullmatch(series.pattern, number)
            assert found is not None
            for group in found.groupdict():
                first, last = found.span(group)
                codes = [*series.codes.get(group, ("", {}))[1], *_CODES.get(group, ())]
                read = [
                    tried(part_numbers.decode, series.maker, f"{number[:first]}{code}{number[last:]}") for code in codes
                ]
                yield f"{number} {group} {said([*zip(codes, read, strict=True)])}"
        yield f"{series.pattern} {said(own)}"
    for part in bought:
        others = draw.sample(bought, 4)
        wrong: list[Part] = [dataclasses.replace(part, mpn=one.mpn, manufacturer=one.manufacturer) for one in others]
        wrong += [dataclasses.replace(part, value=one.value, footprint=one.footprint) for one in others]
        wrong += [dataclasses.replace(part, description=one.description, symbol=one.symbol) for one in others]
        wrong += [dataclasses.replace(part, facts={name: value * 1.5 for name, value in part.facts.items()})]
        yield said([part.mpn, part_numbers.disagreements(part), *map(part_numbers.disagreements, wrong)])
    for name in part_numbers._UNITS:
        text = "35 V 35V 4k7 100nF 1 % 1.5 A 15 mA, 2.2 kV x5V 5Vx 22 uF 1.25 A"
        yield said([name, [*part_numbers._figures(name, text)]])
    yield said([*part_numbers._figures("ohm", "4k7 680R 20k 1R5 x1k 1kx 47 k")])
    yield said([[reader, [tried(read, text) for text in ("104", "0242", "050", "4K7", "R47")]]
                for reader, read in part_numbers._READERS.items()])  # fmt: skip


def slips(draw: random.Random) -> Iterator[str]:
    """Draw slips of order, print and pads, and show what each has changed, and what the checks say of it."""
    design = build("rev-b")
    text = (generated_files.GENERATED / "rev-b" / "rev-b.kicad_pcb").read_text(encoding="utf-8")
    board = board_file.read_board(text)
    for ref, part in board.parts.items():
        yield f"{ref} {said(part)}"
    yield said([board.labels, board.bottom_mm])
    makers = (mistakes._order, *[mistakes._print] * 12, *[mistakes._land] * 8, mistakes._bar, mistakes._text_pair,
              mistakes._dot, mistakes._label_pair, mistakes._label_away, mistakes._references, mistakes._gone)  # fmt: skip
    few = {"J1", "J2", "J4", "U3", "D3", "C1", "TP4", "JP1"}
    for maker in [*makers, *[mistakes._order] * 12, *[mistakes._land] * 12]:
        own = maker in (mistakes._order, mistakes._print, mistakes._land)
        name, touches, changed = maker(design, board, draw) if own else maker(board, draw)  # type: ignore[operator]
        yield f"{name} {said([*touches])}"
        if isinstance(changed, BoardDesign):
            yield said(electrical.bom_faults(changed))
            continue
        assert isinstance(changed, board_file.PrintedBoard)
        yield said([part for ref, part in changed.parts.items() if part != board.parts[ref]])
        yield said([mark for mark in changed.labels if mark not in board.labels])
        near = {ref: part for ref, part in changed.parts.items() if ref in few or part != board.parts[ref]}
        smaller = dataclasses.replace(changed, parts=near)
        parts = tuple(one for one in design.components if one.ref in near)
        circuit = dataclasses.replace(design, components=parts)
        slip = mistakes.Mistake(kind="", name=name, touches=frozenset(touches), design=circuit, board=smaller)
        yield said([slip.lines(), changed.labels == board.labels or slip.is_named()])
    yield from _lacks(design, board)
    for seed in (1, 2):
        drawn = mistakes.draw(design, board, seed, 32)
        yield said([[one.kind, one.name, sorted(one.touches)] for one in drawn])
    yield said(drawn[-1].lines())
    both = {ref: board.parts[ref].lands for ref in ("U1", "J1")}
    yield said([printed.nearest(both, (x, x / 2)) for x in (0.0, 0.2, 5.9, 6.1, 20.0)])
    yield said([printed.header_net(text) for text in ("GND", "RST", "DD3", "E1S2", "M2C1", "CON", "DD", "x")])


def _lacks(design: BoardDesign, board: board_file.PrintedBoard) -> Iterator[str]:
    """Leave out what a part of the board has, piece by piece."""
    for ref in ("J3", "D3", "C1", "J2", "U3", "TP4", "Q1", "SW1", "U2"):
        part = board.parts[ref]
        kept = {one: board.parts[one] for one in ("U1", "J4", "R9")}
        circuit = dataclasses.replace(
            design, components=tuple(one for one in design.components if one.ref in {*kept, ref})
        )
        for change in (
            {"footprint": "NONE"}, {"lands": part.lands[:-1]}, {"lands": (*part.lands, part.lands[0])}, {"marks": ()},
            {"lands": tuple(dataclasses.replace(one, net="unconnected-(x)") for one in part.lands)},
            {"lands": tuple(dataclasses.replace(one, at=(one.at[0], one.at[1] + 1.0)) for one in part.lands)},
            {"marks": (*part.marks, *part.marks)}, {"marks": tuple(one for one in part.marks if one.text)},
            {"marks": tuple(dataclasses.replace(one, is_filled=False) for one in part.marks)},
            {"marks": tuple(dataclasses.replace(one, points=tuple((x + 7.0, y) for x, y in one.points)) for one in part.marks)},
        ):  # fmt: skip
            wrong = dataclasses.replace(board, parts={**kept, ref: dataclasses.replace(part, **change)}, labels=())  # type: ignore[arg-type]
            yield f"{ref} {[*change]} {tried(lands.faults, wrong, circuit)} {tried(printed.faults, wrong, circuit)}"


def routes(draw: random.Random) -> Iterator[str]:
    """Take tracks and vias away, move their ends, and make them thinner."""
    for variant in VARIANTS:
        design = build(variant)
        tracks, vias = load_routes(design)
        yield said([len(tracks), len(vias), [*draw.sample(tracks, 8)], [*draw.sample(vias, 4)]])
        if variant == "rev-c":
            dropped = {*draw.sample(range(len(tracks)), 6)}
            others = [_bent(draw, track) if draw.random() < 0.01 else track
                      for number, track in enumerate(tracks) if number not in dropped]  # fmt: skip
            yield said(copper.faults(design, others, draw.sample(vias, len(vias) - 3)))


def _bent(draw: random.Random, track: Track) -> Track:
    by = draw.choice((0.1, 0.25, 1.0))
    changes: tuple[dict[str, object], ...] = ({"width_mm": track.width_mm - by}, {"layer": 1 - track.layer}, {"net": "NONE"},
               {"start_mm": (track.start_mm[0] + by, track.start_mm[1])}, {"end_mm": track.start_mm})  # fmt: skip
    return dataclasses.replace(track, **draw.choice(changes))  # type: ignore[arg-type]


def simulations(draw: random.Random) -> Iterator[str]:
    """Show every deck, what reads it and its page, and netlists of circuits with faults."""
    for one in decks.decks():
        yield rounded(said(one))
        yield run.deck_text(one, Path("traces.txt"))
        for place in (0.0, 0.5, 1.0, 1.01):
            values = {limit.measure: limit.low + place * (limit.high - limit.low) for limit in one.limits}
            yield said([good for *_, good in run.DeckResult(deck=one, figures=values, columns=[]).verdicts()])
        yield page.page_text((one,), {one.name: values})
    yield said([page.shown(value) for value in (0, 0.01, 0.00999, 9999.4, 10000, -0.5, -1e-5, 123456.0)])
    yield said(deck.limits(("top", 1.0, 2.0, "V", "highest")))
    for variant in VARIANTS:
        design = build(variant)
        for mutant in draw.sample(mutants.draw(design, 9), 3):
            wrong = mutants.apply(design, mutant)
            yield netlist.circuit(wrong, closed=[("JP1.1", "JP1.2"), ("J5.1", "J5.2")], without=("LED",), fuse_ohm=0.2)
        yield said([netlist.node(design, pin) for pin in ("U2.IO17", "U1.5V", "U5.13", "U2.NC", "X1.3", "U1.40")])


def commands(draw: random.Random) -> Iterator[str]:
    """Show each verb's help, and tables of checks."""
    verbs = ("build", "check", "route", "stitch", "simulate", "diff")
    for main, own in ((command.main, verbs), (case_command.main, verbs[:2])):
        for words in (["--help"], *([verb, "--help"] for verb in own)):
            with (
                contextlib.redirect_stdout(io.StringIO()) as out,
                contextlib.redirect_stderr(io.StringIO()) as err,
                contextlib.suppress(SystemExit),
                patch.dict(os.environ, COLUMNS="200"),
            ):
                main(words)
            yield " ".join((out.getvalue() + err.getvalue()).split())
    some = [results.judged("a", "rev-b", draw.random() < 0.5, "why") for _ in range(3)]
    some += [results.skipped("longer", "all", "not there"), results.listed("b", "x", ["one", "two"], "fine")]
    some += [results.listed("c", "lm317", [], "fine")]
    yield results.table(some)


TRACES: dict[str, Trace] = {each.__name__: each for each in (circuits, orders, slips, routes, simulations, commands)}
TRACES["declared"] = declared_of(*PACKAGES)
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
