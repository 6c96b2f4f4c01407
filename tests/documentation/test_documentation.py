"""What holds the pages to the truth notices a page that lies."""

import shutil
from pathlib import Path

import pytest

from tests.documentation.command_lines import command_line, faults
from tests.documentation.page import ROOT, Page, pages
from tests.documentation.session import Session, run_blocks

GROUP = command_line()


@pytest.fixture
def page_of(tmp_path: Path):
    def make(text: str) -> Page:
        path = tmp_path / "page.md"
        path.write_text(text, encoding="utf-8")
        return Page(path)

    return make


@pytest.mark.parametrize(
    "line",
    [
        "p2os fly",
        "p2os drive URL --forwards 1m",
        "p2os mcu fly",
        "p2os send · fly · drive",
        "p2os decode --profile ros x",
        "p2os serve --bodies",
    ],
)
def test_a_verb_an_option_or_a_choice_that_does_not_exist_is_found(line: str) -> None:
    assert list(faults(line, GROUP))


@pytest.mark.parametrize(
    "line",
    [
        "p2os run … --mode direct",
        "p2os mcu run | debug",
        "p2os VERB",
        "p2os serve --robots",
        "p2os decode --profile AROS x",
        "p2os drive tcp:127.0.0.1:8101 --vel -0.2m/s   # back",
        "p2os world list · show --trace",
    ],
)
def test_what_stands_for_other_words_is_no_fault(line: str) -> None:
    assert not list(faults(line, GROUP))


def test_headings_have_the_anchors_that_github_gives_them(page_of) -> None:
    page = page_of("# `[[fault]]`: Faults, and\n## Twice\n## Twice\n```sh\n# none\n```\n")
    assert page.anchors == {"fault-faults-and", "twice", "twice-1"}


def test_a_link_in_code_is_none(page_of) -> None:
    assert [link[1:] for link in page_of("[a](b.md#c) `[d](e.md)` ![f](g.png)").links()] == [
        ("b.md", "c"), ("g.png", ""),
    ]  # fmt: skip


def test_a_block_keeps_the_notes_directly_before_it_and_no_others(page_of) -> None:
    first, second = page_of(
        "<!-- slow: x -->\n<!-- given: a = b -->\n```sh\nc\n```\n<!-- slow: y -->\n\n```sh\n```\n"
    ).blocks
    assert (first.note("slow"), first.note("given"), second.note("slow")) == ("x", "a = b", None)


@pytest.mark.parametrize(
    ("block", "what"),
    [
        ("```console\n$ python -c 'raise SystemExit(3)'\n```", "exit code 3"),
        ("```console\n$ python -c 'print(7)'\np2os: it failed\n```", "exit code 0"),
        ("```console\n$ python -c 'print(7)'\nseven\n```", "the page shows"),
        ("```console\n$ no-such-program\n```", "exit code 127"),
        ("```python\nassert False\n```", "exit code 1"),
        ("```c\nint main(void) { return x; }\n```", "exit code 1"),
        ("```console\n$ p2os serve --body kinematic\nudp:\n```", "the page shows"),
    ],
)
def test_a_block_that_does_not_go_as_it_says_fails(page_of, block: str, what: str) -> None:
    if "```c\n" in block and shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("no arm-none-eabi-gcc")
    with pytest.raises(AssertionError, match=what):
        run_blocks(page_of(block), 0)


@pytest.mark.parametrize(("note", "pace"), [("", 0), ("<!-- slow: x -->\n", 1), ("<!-- soak: x -->\n", 2)])
def test_a_block_runs_at_its_pace_and_above(page_of, note: str, pace: int) -> None:
    page = page_of(f"{note}```python\nassert False\n```")
    for below in range(pace):
        run_blocks(page, below)
    for above in range(pace, 3):
        with pytest.raises(AssertionError, match="exit code 1"):
            run_blocks(page, above)


def test_folders_environments_and_shown_numbers_are_followed(page_of) -> None:
    with Session() as session:
        for block in page_of(
            "```toml\n# new/one.toml\na = 1\n```\n"
            "```sh\npython3 -m venv .venv\n. .venv/bin/activate\npip install '.[sim]'\ncd new\n```\n"
            "```console\n$ python -c 'print(open(\"one.toml\").read(), 12.5)'\na = 3\n99.25\n```\n"
            "```console\n$ p2os --version   # ours\n0.1.0\n```\n"
        ).blocks:
            session.take(block)


def test_a_client_of_a_robot_that_nobody_serves_gets_one_and_lets_it_go(page_of) -> None:
    with Session() as session:
        session.take(page_of("```console\n$ p2os info serial:/dev/ttyUSB0\n```").blocks[0])
        folder = session._folder
    assert not folder.exists()


def test_every_page_of_the_repository_is_looked_at() -> None:
    assert {ROOT / "README.md", ROOT / "docs" / "cli.md", ROOT / "adapter_fw/library/README.md"} <= {
        page.path for page in pages()
    }
