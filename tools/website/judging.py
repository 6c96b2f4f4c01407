"""What is wrong with a built site: links and anchors that lead nowhere, requests to other hosts, an empty search."""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: Attributes by which a browser fetches something without being asked; of `link`, by its `rel`.
FETCHED = {"src", "srcset", "poster", "data"}
FETCHING_RELS = {"stylesheet", "icon", "preload", "prefetch", "preconnect", "dns-prefetch", "manifest", "modulepreload"}
OUTSIDE = re.compile(r"(?:[a-z]+:)?//", re.IGNORECASE)
IN_STYLES = re.compile(r"url\(\s*['\"]?(?P<url>[^'\")]+)|@import\s+['\"](?P<other>[^'\"]+)")


@dataclass
class Built(HTMLParser):
    """A built page: what it has anchors for, links to and fetches."""

    path: Path
    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        text = self.path.read_text(encoding="utf-8")
        self.feed(text)
        self.fetched += in_styles("".join(re.findall(r"<style[^>]*>(.*?)</style>", text, re.DOTALL)))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag names."""
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        self.fetched += [given[name] for name in FETCHED if name in given]
        self.fetched += in_styles(given.get("style", ""))
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif "href" in given and (tag != "link" or FETCHING_RELS & set(given.get("rel", "").split())):
            self.fetched.append(given["href"])


def in_styles(text: str) -> list[str]:
    """Return what a style sheet fetches."""
    return [found["url"] or found["other"] for found in IN_STYLES.finditer(text)]


def faults(folder: Path) -> list[str]:
    """Return what is wrong with a site, a line each, sorted."""
    read = cache(Built)
    found = [
        f"{page.relative_to(folder)}: {fault}"
        for page in sorted(folder.rglob("*.html")) if "files" not in page.relative_to(folder).parts
        for fault in _of_page(read(page), folder, read)
    ]  # fmt: skip
    for sheet in sorted(folder.rglob("*.css")):
        found += [f"{sheet.relative_to(folder)}: fetches {url}"
                  for url in in_styles(sheet.read_text(encoding="utf-8")) if OUTSIDE.match(url)]  # fmt: skip
    index = folder / "search.json"
    if not index.is_file() or not json.loads(index.read_text(encoding="utf-8"))["items"]:
        found.append("the search index is empty")
    return found


def _of_page(page: Built, folder: Path, read: Callable[[Path], Built]) -> Iterator[str]:
    for url in page.fetched:
        if OUTSIDE.match(url):
            yield f"fetches {url}"
    for link in [*page.links, *page.fetched]:
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        here = folder if parts.path.startswith("/") else page.path.parent
        target = (here / unquote(parts.path).lstrip("/")).resolve() if parts.path else page.path
        target = target / "index.html" if target.is_dir() else target
        if not target.is_relative_to(folder) or not target.is_file():
            yield f"no {link}"
        elif parts.fragment and target.suffix == ".html" and unquote(parts.fragment) not in read(target).anchors:
            yield f"no anchor {link}"
