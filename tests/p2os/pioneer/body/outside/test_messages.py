"""Every message of the protocol is the same after its bytes; a cut or changed one is refused, or is another message."""

import math
import re
import struct
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.pioneer.body.outside import messages
from p2os.pioneer.body.outside.messages import (
    FIELDS,
    LARGEST,
    REQUESTS,
    Message,
    MessageError,
    Ranges,
    Report,
    decode,
    encode,
)
from tests.tools.each_row import each_row

REAL = st.floats(-LARGEST, LARGEST)
DISTANCE = REAL | st.just(math.inf)
KINDS = {"d": REAL, "B": st.integers(0, 0xFF), "H": st.integers(0, 0xFFFF), "I": st.integers(0, 2**32 - 1),
         "Q": st.integers(0, 2**64 - 1)}  # fmt: skip


def layout(record: messages._Record) -> st.SearchStrategy[object]:
    text = record._struct.format.lstrip("<")
    letters = "d" * int(text[:-1]) if text[:-1].isdigit() else text
    kinds = KINDS | ({"d": DISTANCE} if record._may_be_infinite else {})
    each = [kinds[letter] for letter in letters]
    return each[0] if len(text) == 1 else st.tuples(*each)


def values(field: object) -> st.SearchStrategy[object]:
    match field:
        case messages._Record():
            return layout(field)
        case messages._Text():
            return st.text(st.characters(exclude_categories=("Cs",)), max_size=20)
        case messages._Blob():
            return st.binary(max_size=40)
        case messages._Table():
            return st.lists(layout(field._row), max_size=4).map(tuple)
        case messages._List():
            return st.lists(st.tuples(*map(values, field._fields)), max_size=3).map(tuple)
    raise TypeError(field)


ANY = st.sampled_from(sorted(FIELDS, key=lambda made: made.__name__)).flatmap(
    lambda made: st.tuples(*map(values, FIELDS[made])).map(lambda fields: made(*fields))
)


def test_every_message_has_its_fields_and_every_request_its_number() -> None:
    assert all(len(made._fields) == len(fields) for made, fields in FIELDS.items())
    numbers = [number for number, _ in REQUESTS.values()]
    assert sorted(numbers) == list(range(1, len(REQUESTS) + 1))


def numbers(record: messages._Record) -> str:
    text = record._struct.format.lstrip("<")
    letters = "d" * int(text[:-1]) if text[:-1].isdigit() else text
    names = {"d": "f64", "B": "u8", "H": "u16", "I": "u32", "Q": "u64"}
    runs = [(names[letter], len(list(run))) for letter, run in groupby(letters)]
    return ", ".join(name if count == 1 else f"{count} {name}" for name, count in runs)


def written(field: object) -> str:
    match field:
        case messages._Record():
            return numbers(field)
        case messages._Table():
            return f"{numbers(messages._Record(field._count.format[1:]))} × ({numbers(field._row)})"
        case messages._List():
            return f"u16 × ({', '.join(map(written, field._fields))})"
    return "text" if isinstance(field, messages._Text) else "blob"


def test_the_page_has_every_message_with_its_fields() -> None:
    lines = Path(__file__).parents[5].joinpath("docs/outside-body.md").read_text(encoding="utf-8").splitlines()
    rows = [tuple(cell.strip() for cell in line.split("|")[1:-1]) for line in lines if re.match(r"\| \d+ \|", line)]

    def cells(made: type[Message]) -> tuple[str, str]:
        return made.__name__, ", ".join(map(written, FIELDS[made]))

    expected = [(str(number), *cells(request), *cells(answer)) for request, (number, answer) in REQUESTS.items()]
    assert rows == expected


@given(ANY, st.integers(1, 255))
def test_a_message_comes_back_from_its_bytes_and_from_no_others(message: Message, change: int) -> None:
    data, payload = encode(message, 9), encode(message, 9)[5:]
    assert struct.unpack_from("<IB", data) == (len(data) - 4, 9)
    again = decode(type(message), payload)
    assert again == message
    assert encode(again, 9) == data
    for size in range(len(payload)):  # cut anywhere
        with pytest.raises(MessageError, match=r"early|too many"):
            decode(type(message), payload[:size])
    with pytest.raises(MessageError, match="1 bytes too many"):
        decode(type(message), payload + b"\0")
    for at in range(len(payload)):  # with a changed byte
        other = payload[:at] + bytes([payload[at] ^ change]) + payload[at + 1 :]
        try:
            found = decode(type(message), other)
        except MessageError:
            continue
        assert found != message or found == again  # -0.0 is 0.0
        assert encode(found, 9)[5:] == other


@given(st.binary(max_size=80), st.sampled_from(list(FIELDS)))
def test_any_bytes_are_a_message_or_refused(data: bytes, made: type[Message]) -> None:
    try:
        found = decode(made, data)
    except MessageError:
        return
    assert encode(found, 0)[5:] == data


@each_row("bad", [math.nan, math.inf, -math.inf, LARGEST * 1.0001, -1e300])
@each_row("at", range(13))
def test_a_state_with_what_is_no_number_of_a_robot_is_refused(bad: float, at: int) -> None:
    data = struct.pack("<13d", *(bad if place == at else LARGEST for place in range(13)))
    with pytest.raises(MessageError, match="where a number within 1e"):
        decode(Report, data)


def test_no_echo_is_infinite_and_nothing_else_is() -> None:
    assert decode(Ranges, encode(Ranges((0.0, math.inf)), 1)[5:]) == Ranges((0.0, math.inf))
    for bad in (math.nan, -math.inf):
        with pytest.raises(MessageError):
            decode(Ranges, struct.pack("<Hdd", 2, math.inf, bad))


def test_what_does_not_fit_its_field_is_refused_before_it_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MessageError, match="65535 bytes"):
        encode(messages.Failed("x" * 65_536), 0xFF)
    with pytest.raises(MessageError, match="cannot be written"):
        encode(messages.AskRanges((70_000,)), 10)
    monkeypatch.setattr(messages, "LONGEST_FRAME", 12)
    encode(messages.Restore(b"1234567"), 13)
    with pytest.raises(MessageError, match="longer than 12"):
        encode(messages.Restore(b"12345678"), 13)
