"""The table of commands: complete, two-way for every row, and clear about what does not fit."""

import pytest
from hypothesis import given, settings

from p2os.errors import LocalProtocolError
from p2os.protocol.commands import ROWS, Argument, Command, CommandNumber, CommandRow, command, command_row
from p2os.protocol.profiles import Profile
from tests.p2os.protocol.drawn_packets import SEEDS, Draw, pairs_of_bytes
from tests.tools.each_row import each_row


def argument_of(row: CommandRow, draw: Draw) -> int | bytes | None:
    kind = draw.one_of(*row.kinds)
    if kind is Argument.NONE:
        return None
    least, most = row.limits(kind)
    if kind in {Argument.STRING, Argument.DATA}:
        return draw.bytes_of(least, most)
    return draw.integer(least, most)


def ends_of(row: CommandRow, kind: Argument) -> list[int | bytes | None]:
    """Return the least and the most that a row takes, numbers or lengths."""
    if kind is Argument.NONE:
        return [None]
    least, most = row.limits(kind)
    if kind in {Argument.STRING, Argument.DATA}:
        return [b"a" * least, b"a" * most]
    return [least, most]


def test_every_number_has_one_row() -> None:
    assert sorted(row.number for row in ROWS) == sorted(CommandNumber)
    assert len({row.name for row in ROWS}) == len(ROWS)


def test_a_row_says_everything() -> None:
    for row in ROWS:
        assert row.meaning.endswith((".", ")")), row
        assert len(row.versions) == len(Profile), row
        assert row.takes, row
        assert (row.kind is Argument.TWO_BYTES) == (row.two_bytes is not None), row
        assert {row.is_known_to(profile) for profile in Profile} <= {True, False, None}, row
        assert command_row(row.name.lower()) is command_row(int(row.number)) is row


def survives(row: CommandRow, argument: int | bytes | None) -> None:
    row.check(argument)
    made = command(row.name, *(() if argument is None else (argument,)))
    assert made == Command(row.number, argument)
    assert Command.from_frame(made.to_frame()) == made
    assert made.row is row
    assert made.name == row.name


def test_every_row_survives_the_wire_at_its_ends() -> None:
    for row in ROWS:
        for kind in row.kinds:
            for argument in ends_of(row, kind):
                survives(row, argument)


@given(SEEDS)
@settings(max_examples=20)
def test_every_row_survives_the_wire(seed: int) -> None:
    draw = Draw(seed)
    for row in ROWS:
        survives(row, argument_of(row, draw))


@pytest.mark.parametrize("row", [row for row in ROWS if row.two_bytes], ids=lambda row: row.name)
def test_two_bytes_survive_whatever_their_signs(row: CommandRow) -> None:
    assert row.two_bytes is not None
    for low, high in pairs_of_bytes(*row.two_bytes.limits):
        made = Command.from_frame(command(row.name, low, high).to_frame())
        assert (made.signed_bytes if row.two_bytes.is_signed else made.two_bytes) == (low, high)


@each_row(
    ("which", "argument", "said"),
    [
        ("VEL", (), "VEL: None is not what it takes: integer of -32767 to 32767 mm/s"),
        ("VEL", (40000,), "40000"),
        ("VEL", (b"1",), "1 bytes is not what it takes"),
        ("ENABLE", (2,), "integer of 0 to 1"),
        ("STOP", (1,), "no argument"),
        ("PULSE", (b"",), "no argument"),
        ("OPEN", (b"",), "no argument or integer"),
        ("HOSTBAUD", (5,), "0 to 4"),
        ("SIM_SET_POSE", (bytes(11),), "data of 12 bytes"),
        ("VEL2", (128, 0), "right and left, each -128 to 127"),
        ("VEL", (1, 2), "does not carry two bytes"),
        ("VEL2", (b"1", 2), "takes"),
        ("VEL2", (1, 2, 3), "3 arguments"),
        ("VELL", (1,), "no command 'VELL'"),
        (200, (), "no manual names command 200"),
    ],
)
def test_what_does_not_fit_is_told(which: int | str, argument: tuple, said: str) -> None:
    with pytest.raises(LocalProtocolError, match=said):
        command(which, *argument)


@pytest.mark.parametrize(("alias", "name"), [("sync0", "PULSE"), ("estop", "E_STOP"), ("e-stop", "E_STOP")])
def test_other_words_lead_to_the_same_command(alias: str, name: str) -> None:
    assert command_row(alias).name == name


def test_a_misspelt_name_gets_a_hint_and_an_odd_one_the_page() -> None:
    with pytest.raises(LocalProtocolError) as caught:
        command_row("GRIPER")
    assert caught.value.hint == "did you mean 'GRIPPER'?"
    with pytest.raises(LocalProtocolError) as caught:
        command_row("qqqqqqqq")
    assert caught.value.hint == "PROTOCOL.md has all"


def test_the_table_tells_the_families_apart() -> None:
    assert [command_row("ROTATE").is_known_to(profile) for profile in Profile] == [False, True, True]
    assert command_row("PTUPOS").is_known_to(Profile.ARCOS) is None
    assert command_row("CONFIG").version(Profile.P2OS) == "1.4"
    assert command_row("SIM_STAT").is_simulator_only
    assert not command_row("VEL").is_simulator_only


def test_a_simulator_command_has_no_length_byte() -> None:
    pose = bytes.fromhex("e8030000 18fcffff 5a000000")
    frame = command("SIM_SET_POSE", pose).to_frame()
    assert frame.payload == b"\xe0\x2b" + pose
    assert Command.from_frame(frame).argument == pose


def test_data_without_a_length_byte_fills_a_frame() -> None:
    whole = command("SIM_CTRL", bytes(range(200)))
    assert Command.from_frame(whole.to_frame()) == whole
