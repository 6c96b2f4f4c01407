"""Copies of `dodge` with one mistake each, as a programmer makes them: replacements in its sources, and what is true.

`answers` are words of which one has to stand in what `p2os explain` calls the cause for it to count as right.
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

from robot_bench.firmware.build import HERE, PROGRAMS, build_elf

#: Independent watchdog, started with 0.4 s (40 kHz / 64, 250 ticks); fed by a write of 0xAAAA.
_WATCHDOG = (
    ("dodge.c", "int main(void)\n{", "#define IWDG ((volatile unsigned *)0x40003000)\n\nint main(void)\n{"),
    (
        "dodge.c", "    dodge_start(&dodge);\n",
        "    dodge_start(&dodge);\n    IWDG[0] = 0x5555; IWDG[1] = 4; IWDG[2] = 250; IWDG[0] = 0xCCCC;\n",
    ),
)  # fmt: skip
_READ = "dodge_tick(&dodge, pins_distances(), "


@dataclass(frozen=True, slots=True, kw_only=True)
class Bug:
    """A mistake: (file, old text, new text) of each replacement, and words of a right answer."""

    name: str
    edits: tuple[tuple[str, str, str], ...]
    answers: tuple[str, ...]
    #: As long as the mistake takes to show, and some.
    duration_s: float = 45.0
    #: A thing that is placed when the robot drives, as keys of `[[obstacle]]`; empty for none.
    thing: str = ""
    placed_s: float = 5.0
    #: Where the robot begins, on the line along which it looks: a wall stands across it at 3.05.
    x_m: float = -2.0
    #: Whether the run fails at all, and whether `explain` finds the mistake.
    fails: bool = True
    is_found: bool = True


_POST = 'shape = "cylinder"\nradius_m = 0.1\nheight_m = 0.5\nbefore_sonar = 3\ndistance_m = 0.25'
_POST_ON_THE_LEFT, _POST_ON_THE_RIGHT = (_POST.replace("before_sonar = 3", f"before_sonar = {n}") for n in (2, 6))
#: A wall so near that the first turn comes 6 s after power-on, the second at 12 s.
_NEAR = 1.7
_BOX = 'shape = "box"\nlength_m = 0.1\nwidth_m = 0.8\nheight_m = 0.5\nbefore_sonar = 4\ndistance_m = 0.3'
#: So near that no program can help it.
UNFAIR = _BOX.replace("0.3", "0.2")
_SETS = "        pins_motors(command.left, command.right);"
_TURNS = "        pins_motors(turns ? 2 : 3, turns ? -2 : 3);"
_AHEAD = 'shape = "cylinder"\nradius_m = 0.05\nheight_m = 0.5\nx_m = -0.8\ny_m = 0.0'


def scenario_text(thing: str, duration_s: float, placed_s: float = 5.0, x_m: float = -2.0) -> str:
    """Return a scenario: the room, a start that looks along it, a thing on the way, and the goals of `dodge`."""
    placed = f'[[obstacle]]\nat_s = {placed_s}\nop = "place"\nname = "post"\n{thing}\n' if thing else ""
    return f"""firmware = "dodge.elf"
world = "room"
body = "kinematic"
duration_s = {duration_s}
threshold_m = 0.6
[start]
x_m = {x_m}
y_m = 0.0
heading_deg = 0.0
{placed}[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m_a_minute = {0.5 if thing else 5.0}
[[goal]]
kind = "happens"
event = "usart1 sends dodge: ready"
most = 1
"""


def build(bug: Bug, folder: Path) -> Path:
    """Build the copy into a folder and return its ELF."""
    sources = folder / "src"
    shutil.copytree(HERE, sources, ignore=shutil.ignore_patterns("*.elf", "__pycache__", "*.py"))
    for name, old, new in bug.edits:
        text = (sources / name).read_text()
        assert old in text, f"{bug.name}: {name} has no {old!r}"
        (sources / name).write_text(text.replace(old, new))
    built = folder / f"{bug.name}.elf"
    build_elf(
        PROGRAMS["dodge"], folder=sources, linker_script="f103c8.ld", output=built,
        more_flags=("-Wno-error", "-Wno-unused"),
    )  # fmt: skip
    return built


def _overflow(after_s: int) -> Bug:
    """Return a count of milliseconds in 16 bits that overflows after 65 s, or earlier: then it began with some."""
    begun_ms = 65_000 - 1000 * after_s
    return Bug(
        name=f"overflow-after-{after_s}-s",
        edits=(
            (
                "dodge.c", "        struct dodge_command",
                ("        static uint8_t sensors;\n        static uint32_t next_ms;\n        static uint16_t now_ms;\n"
                f"        now_ms = (uint16_t)(tick_now() * 10u + {begun_ms}u);\n"
                "        if (next_ms == 0 || now_ms >= next_ms) {\n            next_ms = now_ms + 20u;\n"
                "            sensors = pins_distances();\n        }\n        struct dodge_command"),
            ),
            ("dodge.c", _READ, "dodge_tick(&dodge, sensors, "),
        ),
        answers=("no notice of any", "now_ms"), thing=_BOX, placed_s=after_s + 5.0, duration_s=after_s + 10.0,
    )  # fmt: skip


#: Asked for by name.
NAMED = (
    Bug(
        name="sensor-order-swapped",
        edits=(
            ("board.h", "X(DD3, A, 6)", "X(DD3, X, 0)"), ("board.h", "X(DD6, B, 1)", "X(DD6, A, 6)"),
            ("board.h", "X(DD3, X, 0)", "X(DD3, B, 1)"),
        ),
        answers=("DD3 and DD6 exchanged",), thing=_POST, duration_s=10.0,
    ),
    Bug(
        name="stale-reading",
        edits=(
            (
                "dodge.c", "        struct dodge_command",
                ("        static uint8_t sensors;\n        if (due % 200 == 0) {\n"
                    "            sensors = pins_distances();"
                "\n        }\n        struct dodge_command"),
            ),
            ("dodge.c", _READ, "dodge_tick(&dodge, sensors, "),
        ),
        answers=("late",), thing=_BOX, duration_s=10.0,
    ),
    _overflow(after_s=15),
    Bug(
        name="con-not-raised-on-reconnect",
        edits=(
            ("pins.h", "#endif", "void pins_connect(int high);\n\n#endif"),
            (
                "pins.c", "uint8_t pins_distances(void) {",
                ("void pins_connect(int high) { write_wire(control_wires[P2DX_CON], high); }\n"
                "uint8_t pins_distances(void) {"),
            ),
            (
                "dodge.c", "        pins_motors(command",
                ("        static int reconnects;\n        if (dodge.turns == 2 && !reconnects) {\n"
                "            reconnects = 1;\n            pins_connect(0);\n        }\n        pins_motors(command"),
            ),
        ),
        answers=("p2dx_con",), x_m=_NEAR, duration_s=20.0,
    ),
    Bug(
        name="watchdog-not-fed-in-a-branch",
        edits=(
            *_WATCHDOG,
            (
                "dodge.c", "        pins_motors(command",
                ("        if (dodge.state != DODGE_TURN_LEFT && dodge.state != DODGE_TURN_RIGHT) {\n"
                "            IWDG[0] = 0xAAAA;\n        }\n        pins_motors(command"),
            ),
        ),
        answers=("watchdog",), x_m=_NEAR, duration_s=12.0,
    ),
)  # fmt: skip

#: Of kinds that nothing was made for.
OTHERS = (
    Bug(
        name="motor-sign-wrong",
        edits=(("motors_bits.c", "write_code(right_wires, right)", "write_code(right_wires, -right)"),),
        answers=("opposite ways",), duration_s=12.0,
    ),
    Bug(
        name="pin-masked",
        edits=(("dodge.c", _READ, "dodge_tick(&dodge, pins_distances() & 0xE7, "),),
        answers=("ignores DD4",), thing=_AHEAD, duration_s=10.0,
    ),
    Bug(
        name="last-sensors-not-looped-over",
        edits=(("pins.c", "uint8_t pins_distances(void) { return read_value(distance_wires, COUNT(distance_wires)); }",
                "uint8_t pins_distances(void) { return read_value(distance_wires, COUNT(distance_wires) - 4); }"),),
        answers=("DD5", "DD6", "DD7", "DD8"), thing=_POST_ON_THE_RIGHT, duration_s=10.0,
    ),
    Bug(
        name="timer-ten-times-slow",
        edits=(("tick.c", "HCLK_HZ / TICKS_PER_S - 1u", "HCLK_HZ / TICKS_PER_S * 20u - 1u"),),
        answers=("not begun to drive", "late"), duration_s=12.0,
    ),
    Bug(
        name="dead-branch",
        edits=(("dodge_fsm.c", "if (!(dodge->seen & FRONT) && ", "if (!(dodge->seen & FRONT & 0) && "),),
        answers=("drives straight on",), x_m=_NEAR, duration_s=11.0,
    ),
    Bug(
        name="null-pointer-in-a-branch",
        edits=(
            (
                "dodge_fsm.c", "    dodge->turns++;",
                ("    static const struct dodge *other = (const struct dodge *)0x30000000;\n"
                "    dodge->turns += dodge->turns > 0 ? other->turns : 1;"),
            ),
        ),
        answers=("died",), x_m=_NEAR, duration_s=14.0,
    ),
    Bug(
        name="waits-for-ever",
        edits=(
            (
                "dodge.c", "            print_transition(before, &dodge);",
                "            while (dodge.turns == 2) {\n            }\n            print_transition(before, &dodge);",
            ),
        ),
        answers=("stuck at dodge.c",), x_m=_NEAR, duration_s=20.0,
    ),
    Bug(
        name="sides-exchanged",
        edits=(("motors_bits.c",
                "    write_code(left_wires, left);\n    write_code(right_wires, right);",
                "    write_code(left_wires, right);\n    write_code(right_wires, left);"),),
        answers=("left and right exchanged",), thing=_POST_ON_THE_LEFT, duration_s=14.0,
    ),
    Bug(
        name="sensor-inverted",
        edits=(("dodge.c", _READ, "dodge_tick(&dodge, pins_distances() ^ 0x08, "),),
        answers=("DD4 inverted",), duration_s=10.0,
    ),
    Bug(
        name="motor-never-reverses",
        edits=(("motors_bits.c", "write_code(right_wires, right)", "write_code(right_wires, right & 3)"),),
        answers=("never asks the right motor to go backwards",), x_m=_NEAR, duration_s=11.0,
    ),
    Bug(
        name="adapter-held-in-reset",
        edits=(
            ("pins.h", "#endif", "void pins_reset(int high);\n\n#endif"),
            (
                "pins.c", "uint8_t pins_distances(void) {",
                ("void pins_reset(int high) { write_wire(control_wires[RST], high); }\n"
                "uint8_t pins_distances(void) {"),
            ),
            (
                "dodge.c", "        pins_motors(command",
                "        if (dodge.turns == 2) {\n            pins_reset(1);\n        }\n        pins_motors(command",
            ),
        ),
        answers=("rst high holds the adapter in reset",), x_m=_NEAR, duration_s=20.0,
    ),
    Bug(
        name="inputs-read-each-1.5-s",
        edits=(
            (
                "dodge.c", "        struct dodge_command",
                ("        static uint8_t sensors;\n        if (due % 150 == 0) {\n"
                "            sensors = pins_distances();\n        }\n        struct dodge_command"),
            ),
            ("dodge.c", _READ, "dodge_tick(&dodge, sensors, "),
        ),
        answers=("late",), thing=_BOX, duration_s=10.0,
    ),
    Bug(
        name="motors-set-once",
        edits=(
            ("dodge.c", "        pins_motors(c", "        if (dodge.state_ticks == 1 && !dodge.turns) pins_motors(c"),
        ),
        answers=("sets its motors no otherwise",), thing=_AHEAD, duration_s=10.0,
    ),
    Bug(
        # What it drives by is the time: it had +2, -2 for the last hundredths of a second.
        name="turns-by-the-clock",
        edits=(
            ("dodge.c", _SETS, "        int turns = (tick_now() - begun + 46) % 100 < 10;\n" + _TURNS),
            ("dodge.c", "    for (uint32_t due", "    uint32_t begun = tick_now();\n    for (uint32_t due"),
        ),
        answers=("sets its motors no otherwise for it (motors +3, +3 for 2.",), thing=_AHEAD, duration_s=10.0,
    ),
    Bug(
        # It does answer, too briefly, and has gone on when it touches.
        name="turns-for-a-moment",
        edits=(
            (
                "dodge.c", _SETS,
                "        static int near;\n        near = pins_distances() & 24 ? near + 1 : 0;\n"
                "        int turns = near && near < 15;\n" + _TURNS,
            ),
        ),
        answers=("briefly",), thing=_AHEAD, duration_s=10.0, is_found=False,
    ),
    Bug(
        name="speed-beyond-the-code",
        edits=(("pins.h", "MOTOR_MAX 3", "MOTOR_MAX 7"), ("dodge_fsm.c", "#define FAST 3", "#define FAST 4")),
        answers=("overflow",), duration_s=12.0, is_found=False,
    ),
    Bug(
        name="encoder-off-by-one",
        edits=(("odometer.c", "STEPS_PER_TURN / 2 + STEPS_PER_TURN)", "STEPS_PER_TURN / 2 + STEPS_PER_TURN - 1)"),),
        answers=("encoder",), x_m=_NEAR, duration_s=12.0, fails=False, is_found=False,
    ),
    Bug(
        name="no-debounce",
        edits=(("dodge_fsm.c", "#define RELEASE_TICKS 25", "#define RELEASE_TICKS 1"),),
        answers=("chatter",), x_m=_NEAR, duration_s=12.0, fails=False, is_found=False,
    ),
)  # fmt: skip

#: Looked at for longer than the rest.
LONGER = (
    _overflow(after_s=65),
    Bug(
        name="motors-lack-a-bit",
        edits=(("motors_bits.c", "i < 3; i++", "i < 2; i++"),),
        answers=("comm3",), x_m=_NEAR, duration_s=20.0, is_found=False,
    ),
    Bug(
        name="debounce-of-2-s",
        edits=(
            (
                "dodge.c", "        struct dodge_command",
                ("        static uint8_t high_ticks[8];\n        uint8_t sensors = 0, raw = pins_distances();\n"
                "        for (int i = 0; i < 8; i++) {\n"
                "            high_ticks[i] = raw >> i & 1 ? high_ticks[i] + (high_ticks[i] < 200) : 0;\n"
                "            sensors |= (uint8_t)((high_ticks[i] >= 200) << i);\n"
                "        }\n        struct dodge_command"),
            ),
            ("dodge.c", _READ, "dodge_tick(&dodge, sensors, "),
        ),
        # Not that it would act later: the line that debounces, and for how long nothing came of it.
        answers=("late", "and sets its motors no otherwise for it"), thing=_BOX, duration_s=20.0,
    ),
    Bug(
        name="never-clear-again",
        edits=(("dodge_fsm.c", "++dodge->unseen_ticks[i] >= RELEASE_TICKS", "++dodge->unseen_ticks[i] < 0"),),
        answers=("never leaves what it does",), x_m=_NEAR, duration_s=45.0,
    ),
)  # fmt: skip
