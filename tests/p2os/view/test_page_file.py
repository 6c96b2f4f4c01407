"""The page as one file: what stands in it, and that no text of a recording gets out of its block."""

import base64
import hashlib
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.view.header import ChannelHeader, PageCell, PageHeader, PageSection, PageTable, WorldHeader
from p2os.view.page import LISTED, SCRIPT, STYLE, bundled, document, page_of
from p2os.view.recording import ViewRecording
from tests.p2os.view.pages import ReadPage

#: What is tried by who wants a page to run what a run says.
HOSTILE = [
    "</script><script>alert(1)</script>", "<!--csp-->", "<!--data--><!--script-->", "<img src=x onerror=alert(1)>",
    "\u2028\u2029", "]]>", "<!--", "--><script>", "\0", "'\"&<>", "</title><script>", "${x}", "\ud800",
]  # fmt: skip


def recording(text: str) -> ViewRecording:
    found = ViewRecording(PageHeader(title=text, verdict=text, lead=text, end_ns=1, footer=text, sections=[
        PageSection(title=text, blocks=[PageTable(rows=[[PageCell(text=text, href=text)]])])
    ], world=WorldHeader(name=text, extent_m=(0.0, 0.0, 1.0, 1.0))))  # fmt: skip
    track = found.add(ChannelHeader(name=text, kind="text"))
    track.append(0, 0, text)
    return found


def elements(page: str) -> list[str]:
    """Return the names of the elements that a browser makes of a page, scripts and styles taken as they are."""
    bare = re.sub(r"<(script|style)\b([^>]*)>.*?</\1>", r"<\1>", page, flags=re.DOTALL)
    return re.findall(r"<([a-zA-Z!/][^\s>]*)", bare)


PLAIN = elements(page_of(recording("plain")))


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_texts_are_texts(text: str) -> None:
    page = ReadPage(page_of(recording(text)))
    assert elements(page.text) == PLAIN
    said = text.encode("utf-8", "replace").decode()
    assert page.header["sections"][0]["title"].encode("utf-8", "replace").decode() == said
    (frame,) = page.frames.values()
    assert frame.columns[2] == [said]


@settings(max_examples=10)
@given(st.text(max_size=30))
def test_no_text_changes_the_elements_of_the_page(text: str) -> None:
    assert elements(page_of(recording(text))) == PLAIN


def test_the_policy_admits_the_scripts_of_the_bundle_and_nothing_else() -> None:
    page = page_of(recording("x"))
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy[1].split(";"))
    assert rules["default-src"] == "'none'"
    assert "unsafe" not in policy[1]
    inline = re.findall(r"<script>(.*?)</script>", page, re.DOTALL) + re.findall(
        r"<style>(.*?)</style>", page, re.DOTALL
    )
    assert len(inline) == 2
    for text, rule in zip(inline, ("script-src", "style-src"), strict=True):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in rules[rule].split()
    assert len(rules["script-src"].split()) == 2  # the page's, and that of the 3D view
    assert "connect-src" not in rules


def test_the_same_recording_gives_the_same_bytes() -> None:
    page = page_of(recording("x"))
    assert page == page_of(recording("x"))
    packed = re.findall(r'<script type="application/octet-stream" id="\w+">([^<]*)</script>', page)
    assert len(packed) == 2
    assert {base64.b64decode(block)[4:8] for block in packed} == {bytes(4)}, "no time of packing"


def test_what_is_left_out_is_said_with_where_the_rest_is() -> None:
    found = ViewRecording(PageHeader(title="x", end_ns=10**9))
    lines, other = (found.add(ChannelHeader(name=name, kind="text")) for name in ("a", "b"))
    for n in range(LISTED + 7):
        lines.append(n, 0, "")
    other.append(0, 0, "")
    page = ReadPage(page_of(found, all_is_in="trace.jsonl"))
    assert page.header["left_out"] == [f"text of a: {LISTED + 1} of {LISTED + 8} rows; trace.jsonl has all"]
    assert ReadPage(page_of(recording("x"))).header["left_out"] == []


def test_a_report_without_rows_has_no_frames() -> None:
    page = document(PageHeader(title="x", sections=[PageSection(title="y")]))
    assert 'id="frames"' not in page
    assert 'id="scene"' not in page
    assert ReadPage(page).section("y")["blocks"] == []


def test_the_bundle_can_stand_in_a_page() -> None:
    assert "</script" not in bundled(SCRIPT).lower()
    assert "<!--" not in bundled(SCRIPT)
    assert "</style" not in bundled(STYLE).lower()
    assert "url(http" not in bundled(STYLE).replace("'", "").replace('"', "")
