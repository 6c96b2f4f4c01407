"""The pages about the board say what the design says."""

import re
from pathlib import Path

from adapter_sim.pinout import Pull, WireRole, load_pinout
from hardware.pcb.checks import kicad_checks, suite
from hardware.pcb.checks.pin_checks import BOARDS, count_by_rule, findings
from hardware.pcb.circuit.design import TEST_POINTS, VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.circuit.electrical import BANK_MIN_V, BATTERY_MAX_V, BATTERY_MIN_V, LM317_AVERAGE_MA, LM317_LIMIT_MA
from hardware.pcb.outputs.bom import rows as bom_rows
from hardware.pcb.outputs.steps import STEPS
from hardware.pcb.spice.decks import decks

DOCS = Path(__file__).resolve().parents[2] / "docs"
BOARD, BUILD = ((DOCS / name).read_text(encoding="utf-8") for name in ("board.md", "board-build.md"))


def table(page: str, name: str) -> list[str]:
    """Return the lines of the table behind a mark."""
    lines = page.split(f"<!-- table: {name} -->\n")[1].splitlines()[2:]
    return lines[: next(index for index, line in enumerate(lines) if not line.startswith("|"))]


def test_the_pin_map_of_the_page_is_the_pin_map() -> None:
    pulls = {Pull.DOWN: "20k down", Pull.UP: "20k up"}
    wanted = []
    for wire in load_pinout().wires:
        pins = dict(wire.esp32)
        pull = "47k, base of Q1" if wire.role is WireRole.RESET else pulls[wire.pull]
        wanted.append(f"| {wire.name} | {wire.bluepill} | {pins['rev-b']} | {pins['rev-c']} | {pull} |")
    assert table(BOARD, "pins") == wanted


def test_the_manual_has_voltages_for_every_test_point() -> None:
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table(BUILD, "volts")]
    assert [tuple(row[:2]) for row in rows] == [(f"TP{number}", net) for number, net in enumerate(TEST_POINTS, 1)]
    for *_, bare, full, note in rows:
        for volts in (bare, full):
            low, high = re.fullmatch(r"(-?[\d.]+)(?: to (-?[\d.]+))? V", volts).groups(volts.removesuffix(" V"))
            assert float(low) <= float(high)
        assert note


def test_each_proof_in_the_list_of_faults_exists() -> None:
    source = "".join(Path(module.__file__ or "").read_text(encoding="utf-8") for module in (suite, kicad_checks))
    names = {deck.name for deck in decks()}
    proofs = re.findall(r"(check|sim): ([^,|(]+?)(?: \(([^)]+)\))?(?=[,|]| \|)", BOARD)
    assert len(proofs) > 20
    rules = {rule for board in BOARDS.values() for rule in count_by_rule(findings(load_pinout(), board))}
    for kind, name, rule in proofs:
        if kind == "sim":
            assert name.strip() in names, name
        else:
            assert f'"{name.strip()}"' in source, name
        assert not rule or rule in rules, rule


def test_limits_in_the_manual_are_those_of_the_design() -> None:
    assert f"{BATTERY_MIN_V:g} to {BATTERY_MAX_V:g} V at J1" in BUILD
    assert f"hold {BANK_MIN_V:g} V" in BUILD
    assert f"{LM317_AVERAGE_MA:g} mA on average, {LM317_LIMIT_MA:g} mA in peaks" in BUILD


def test_references_in_the_manual_are_what_it_says_of_them() -> None:
    design = design_of()
    assert design.component("R12").part.value == "680R"
    assert [row.refs for row in bom_rows(design) if row.part.value == "680R"] == [("R12",)]
    assert ("1", "ENCODER2_S2") in design.component("R43").pins
    assert ("1", "ENCODER1_S3") in design.component("R41").pins
    names = {component.ref for variant in VARIANTS for component in design_of(variant).components}
    assert all(("2", "+3V3") in design.component(ref).pins for ref in ("R33", "R44"))
    assert {TEST_POINTS[7], TEST_POINTS[11], TEST_POINTS[4]} == {"ESP_EN", "DSR_N", "+3V3"}
    for ref in re.findall(r"\b(?:R|C|D|U|J|F|Q|JP|TP)\d{1,2}\b", BUILD):
        # JP8 is the robot's.
        assert ref in names | {"JP8"}, ref


def test_every_page_that_names_a_program_to_flash_says_how() -> None:
    programs = ("robot_bench/firmware/board_test.elf", "bluepill_sim/analysis/silicon/kit.elf")
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        for program in programs:
            if program in text:
                assert f'"program {program} verify reset exit"' in text, (page.name, program)


def test_no_page_speaks_of_a_button_that_the_module_does_not_have() -> None:
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert "module's BOOT button" not in text, page.name
        assert "**SW1**" in text or "BOOT button" not in text, page.name
    assert "SW1" in {component.ref for variant in VARIANTS for component in design_of(variant).components}


def test_the_steps_of_the_manual_are_those_of_the_pictures() -> None:
    shown = re.findall(r"!\[Step (\d+)\]\(\.\./hardware/pcb/generated/rev-b/rev-b-step-(\d+)\.svg\)", BUILD)
    assert [(int(one), int(other)) for one, other in shown] == [(n, n) for n in range(1, len(STEPS) + 1)]


def test_the_stop_s_figures_on_the_page_are_those_of_the_simulation() -> None:
    section = (DOCS / "board-simulation.md").read_text(encoding="utf-8").split("## Emergency stop")[1].split("\n## ")[0]
    after = float(re.search(r"from the opening to EN low \| ([\d.e-]+) s", section)[1])
    line = float(re.search(r"at mark although IO17 is low \| (-?[\d.]+) V", section)[1])
    assert f"{1e6 * after:.0f} µs to EN low, TX at {line:.1f} V" in BOARD
