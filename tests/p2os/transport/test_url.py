"""The text that names a line."""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.transport.url import LoopUrl, PtyUrl, SerialUrl, TcpUrl, parse_url
from simbase.errors import P2osError, UsageError
from tests.tools.each_row import each_row


@each_row(
    ("text", "url"),
    [
        ("serial:/dev/ttyUSB0", SerialUrl(path="/dev/ttyUSB0", baud=9600)),
        ("serial:/dev/ttyUSB0?baud=38400", SerialUrl(path="/dev/ttyUSB0", baud=38400)),
        ("serial:COM3", SerialUrl(path="COM3")),
        ("tcp:127.0.0.1:8101", TcpUrl(host="127.0.0.1", port=8101)),
        ("tcp:robot.local:9000", TcpUrl(host="robot.local", port=9000)),
        ("tcp:localhost", TcpUrl(host="localhost", port=8101)),
        ("tcp:", TcpUrl(host="127.0.0.1", port=8101)),
        ("tcp::9000", TcpUrl(host="127.0.0.1", port=9000)),
        ("tcp:10.0.0.1:0", TcpUrl(host="10.0.0.1", port=0)),
        ("tcp:[::1]:8102", TcpUrl(host="::1", port=8102)),
        ("tcp:[::1]", TcpUrl(host="::1", port=8101)),
        ("tcp:[]:9000", TcpUrl(host="127.0.0.1", port=9000)),
        ("pty:", PtyUrl()),
        ("pty:/run/robot", PtyUrl(path="/run/robot")),
        ("loop:robot", LoopUrl(name="robot")),
    ],
)
def test_a_url_is_read_and_written_back(text: str, url: object) -> None:
    assert parse_url(text) == url
    assert parse_url(str(parse_url(text))) == url


@each_row(
    ("text", "message", "hint"),
    [
        ("", "not a port URL", "serial:/dev/ttyUSB0"),
        ("robot", "not a port URL", "serial:/dev/ttyUSB0"),
        ("http://robot", "not a port URL", "serial:/dev/ttyUSB0"),
        ("/dev/ttyUSB0", "not a port URL", "serial:/dev/ttyUSB0?"),
        ("COM3", "not a port URL", "serial:COM3"),
        ("serial:", "names no serial port", "p2os ports"),
        ("serial:/dev/x?parity=odd", "unknown option 'parity'", "baud"),
        ("serial:/dev/x?baud=fast", "baud 'fast' is not a whole number", "serial:"),
        ("serial:/dev/x?baud=0", "not a whole number from 1", "serial:"),
        ("tcp:localhost:http", "port 'http' is not a whole number", "tcp:"),
        ("tcp:localhost:70000", "from 0 to 65535", "tcp:"),
        ("tcp:localhost:٣", "port '٣' is not a whole number", "tcp:"),
        ("tcp:[[", "no host", "tcp:[::1]:8101"),
        ("tcp:[", "no host", "tcp:[::1]:8101"),
        ("tcp:[::1:8101", "no host", "tcp:[::1]:8101"),
        ("loop:", "has no name", "loop:robot"),
        ("tcp://robot:8101", "'//robot' is no host", "without slashes"),
        ("TCP:robot:8101", "not a port URL", "mean tcp:robot:8101?"),
        ("com12", "not a port URL", "mean serial:com12?"),
        ("robot:65535", "not a port URL", "mean tcp:robot:65535?"),
        ("robot:65536", "not a port URL", "use serial:"),
        ("seral:", "not a port URL", "use serial:"),
        ("comet:3", "not a port URL", "mean tcp:comet:3?"),
        ("udp:1", "not a port URL", "use serial:"),
        ("UDP:robot:8101", "not a port URL", "use serial:"),
        (3, "3 is no text with a port URL", "use serial:"),
        (None, "None is no text with a port URL", "use serial:"),
        (b"tcp:", "b'tcp:' is no text with a port URL", "use serial:"),
        (Path("/dev/ttyUSB0"), "is no text with a port URL", "mean 'serial:/dev/ttyUSB0'?"),
    ],
)
def test_a_wrong_url_is_refused_in_words(text: object, message: str, hint: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        parse_url(text)
    assert hint in str(caught.value.hint)
    assert caught.value.exit_code == 2


@given(
    st.from_regex(r"[a-zA-Z]{1,7}:[a-z0-9:./?=\[\]]{0,20}", fullmatch=True)
    | st.builds("{}:{}".format, st.sampled_from(["tpc", "seral", "lop", "host", "10.0.0.1"]), st.integers(0, 99_999))
)
def test_a_url_that_is_said_to_be_meant_is_one(text: str) -> None:
    try:
        parse_url(text)
    except UsageError as error:
        if error.hint is not None and error.hint.startswith("did you mean "):
            parse_url(error.hint.removeprefix("did you mean ").removesuffix("?"))


@given(st.text(max_size=40) | st.from_regex(r"(serial|tcp|pty|loop):[ -~]{0,20}", fullmatch=True))
def test_any_text_is_a_url_or_an_error_of_ours(text: str) -> None:
    try:
        url = parse_url(text)
    except P2osError:
        return
    assert parse_url(str(url)) == url


def test_reading_a_url_needs_no_terminal_and_no_serial_port() -> None:
    code = """
import sys
sys.modules["termios"] = sys.modules["pty"] = sys.modules["tty"] = sys.modules["serial"] = None
from p2os.transport import parse_url
print(parse_url("serial:COM3").path)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=20)
    assert done.stdout == "COM3\n"
