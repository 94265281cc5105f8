"""Checks pages of a folder: what they link to is there, and they load nothing from elsewhere."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class SiteError(Exception):
    """One line for the user."""


# Attributes whose targets browsers load by themselves. `href` is one, except of links.
LOADED = {"src", "srcset", "poster", "data", "background", "manifest", "xlink:href"}
LINKS = {"a", "area"}
# What a policy may allow: nothing from another host.
SOURCES = {"'none'", "'self'", "'unsafe-inline'", "'wasm-unsafe-eval'", "data:", "blob:"}
OF_STYLES = re.compile(r"@import|url\(\s*(?![\s\"']*data:)", re.IGNORECASE)


class Page(HTMLParser):
    """Places, links, and loads of a page, in the order of its text."""

    def __init__(self, text: str):
        super().__init__()
        self.places: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.policies: list[str] = []
        self.wrong: list[str] = []
        self.in_style = False
        self.feed(text)
        self.close()
        if not any("default-src 'none'" in policy for policy in self.policies):
            self.wrong.append("no Content-Security-Policy with default-src 'none'")
        for policy in self.policies:
            self.check_policy(policy)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attributes}
        if "id" in values:
            self.places.add(values["id"])
        if "href" in values:
            (self.links if tag in LINKS else self.loads).append(values["href"])
        self.loads += [values[name] for name in sorted(LOADED & set(values))]
        self.check_style(values.get("style", ""))
        self.in_style = tag == "style"
        if tag == "base":
            self.wrong.append("a <base> element")
        if tag == "meta":
            self.meta(values.get("http-equiv", "").lower(), values.get("content", ""))

    def meta(self, name: str, content: str) -> None:
        if name == "refresh":
            self.wrong.append("a page that leads to another by itself")
        if name == "content-security-policy":
            self.policies.append(content)

    def handle_data(self, data: str) -> None:
        if self.in_style:
            self.check_style(data)

    def handle_endtag(self, tag: str) -> None:
        self.in_style = False

    def check_style(self, text: str) -> None:
        if found := loading_style(text):
            self.wrong.append(f"a style that loads: {found}")

    def check_policy(self, policy: str) -> None:
        for directive in policy.split(";"):
            for source in directive.split()[1:]:
                if source not in SOURCES and not source.startswith("'sha256-"):
                    self.wrong.append(f"a policy that allows {source}")


def loading_style(text: str) -> str | None:
    """Where a style loads something, if it does."""
    found = OF_STYLES.search(text)
    return " ".join(text[found.start() :].split())[:60] if found else None


def target_of(folder: Path, page: Path, link: str) -> tuple[Path, str]:
    """The file and the place of a relative link. Throws SiteError: the file is not there."""
    parts = urlsplit(link)
    path = page
    if parts.path:
        path = Path(os.path.normpath(page.parent / unquote(parts.path)))
    if not path.is_relative_to(folder) or parts.path.startswith("/"):
        raise SiteError(f"{name_of(folder, page)}: {link} leads out of the site")
    if not path.is_file():
        raise SiteError(f"{name_of(folder, page)}: {link}: there is no {name_of(folder, path)}")
    return path, unquote(parts.fragment)


def name_of(folder: Path, path: Path) -> str:
    return str(path.relative_to(folder))


def check_links(folder: Path, paths: Iterable[Path]) -> None:
    """Throws SiteError, one line, if a page links to a file or place that is not in the folder, or
    loads what is not in it."""
    read: dict[Path, Page] = {}

    def page_at(path: Path) -> Page:
        if path not in read:
            read[path] = Page(path.read_text(encoding="utf-8"))
        return read[path]

    for path in paths:
        page, name = page_at(path), name_of(folder, path)
        for load in page.loads:
            if load.startswith("data:"):
                continue
            if urlsplit(load).scheme or load.startswith("//"):
                raise SiteError(f"{name}: loads {load[:80]} from elsewhere")
            target_of(folder, path, load)
        if page.wrong:
            raise SiteError(f"{name}: {page.wrong[0]}")
        for link in page.links:
            if urlsplit(link).scheme in ("https", "http", "mailto"):
                continue
            target, place = target_of(folder, path, link)
            if place and target.suffix == ".html" and place not in page_at(target).places:
                raise SiteError(f"{name}: {link}: {name_of(folder, target)} has no place #{place}")
    for path in sorted(folder.rglob("*.css")):
        if found := loading_style(path.read_text(encoding="utf-8")):
            raise SiteError(f"{name_of(folder, path)} loads: {found}")
