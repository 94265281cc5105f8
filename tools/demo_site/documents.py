"""The project's Markdown as pages, with their links, anchors and images as on GitHub.

The page of core/README.md is docs/core/index.html, that of bench/cpu.md docs/bench/cpu.html. Images
keep their paths under docs/. Licences become texts beside the pages. Other files of the source are
not on the site: links to them are plain text.
"""

from __future__ import annotations

import html
import os
import re
import shutil
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote, urlsplit

from markdown_it import MarkdownIt
from markdown_it.token import Token

from demo_site.links import SiteError

DOCS = Path("docs")
ROOTS = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
ROOMS = ("core", "kernels_cl", "reference", "bench", "tests", "tools")
IMAGES = (".png", ".svg", ".jpg", ".gif")
TEXTS = ("LICENSE", ".cff")  # ends of names
OF_IMAGE = re.compile(r"(<img\b[^>]*?\ssrc=\")([^\"]*)\"")


@dataclass
class Document:
    path: str  # of the Markdown, in the source
    tokens: list[Token]
    title: str = ""
    sections: list[tuple[str, str]] = field(default_factory=list)  # place, text
    links: dict[str, str] = field(default_factory=dict)  # path of the source: line that names it

    @property
    def is_readme(self) -> bool:
        return Path(self.path).name == "README.md"

    def place_in_list(self) -> tuple[int, bool, str]:
        """Documents of the top folder come first, then room by room, each with its README first."""
        if self.path in ROOTS:
            return ROOTS.index(self.path), False, ""
        room = self.path.split("/")[0]
        place = ROOMS.index(room) if room in ROOMS else len(ROOMS)
        return len(ROOTS) + place, self.path != f"{room}/README.md", self.path

    @property
    def page(self) -> Path:
        path = Path(self.path)
        return DOCS / (path.with_name("index") if self.is_readme else path).with_suffix(".html")

    @property
    def first_sentence(self) -> str:
        first = next(i for i, token in enumerate(self.tokens) if token.type == "paragraph_open")
        text = " ".join(text_of(self.tokens[first + 1]).split())
        return re.split(r"(?<=\.) ", text)[0]


def text_of(inline: Token) -> str:
    """Its text without marks."""
    texts = {"text": None, "code_inline": None, "softbreak": " ", "hardbreak": " "}
    return "".join(
        texts[child.type] or child.content for child in inline.children or [] if child.type in texts
    )


def place_of(heading: str, seen: Counter[str]) -> str:
    """As GitHub names it."""
    place = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
    seen[place] += 1
    return place if seen[place] == 1 else f"{place}-{seen[place] - 1}"


def parser() -> MarkdownIt:
    return MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])


def read_document(source: Path, path: str) -> Document:
    text = (source / path).read_text(encoding="utf-8")
    document = Document(path, parser().parse(text))
    seen: Counter[str] = Counter()
    for opening, inline in zip(document.tokens, document.tokens[1:]):
        if opening.type != "heading_open":
            continue
        heading = text_of(inline)
        place = place_of(heading, seen)
        opening.attrSet("id", place)
        if opening.tag == "h1" and not document.title:
            document.title = heading
        if opening.tag == "h2":
            document.sections.append((place, heading))
    document.title = document.title or path
    note_links(source, document)
    return document


def note_links(source: Path, document: Document) -> None:
    """Throws SiteError: a link to a file that is not there."""
    for token in document.tokens:
        line = f"{document.path}:{token.map[0] + 1}" if token.map else document.path
        parts = token.children if token.type == "inline" else [token]
        for part in parts or []:
            targets = [part.attrGet("href") or part.attrGet("src")]
            if part.type in ("html_inline", "html_block"):
                targets = [found[2] for found in OF_IMAGE.finditer(part.content)]
            for target in targets:
                if not target or urlsplit(target).scheme or target.startswith("#"):
                    continue
                path = path_of(document, str(target))
                if path.startswith("../") or not (source / path).exists():
                    raise SiteError(f"{line}: link to {target}: there is no {path}")
                document.links.setdefault(path, line)


def path_of(document: Document, link: str) -> str:
    """Path in the source that a relative link of a document leads to."""
    folder = os.path.dirname(document.path)
    return os.path.normpath(os.path.join(folder, unquote(urlsplit(link).path)))


def read_documents(source: Path) -> dict[str, Document]:
    """Documents by their paths: READMEs, and all Markdown that documents link to."""
    paths = list(ROOTS)
    for room in ROOMS:
        readmes = (source / room).rglob("README.md")
        paths += sorted(str(readme.relative_to(source)) for readme in readmes)
    documents: dict[str, Document] = {}
    while paths:
        path = paths.pop(0)
        if path not in documents:
            documents[path] = read_document(source, path)
            paths += [link for link in documents[path].links if link.endswith(".md")]
    return {each.path: each for each in sorted(documents.values(), key=Document.place_in_list)}


def copied_name(path: str) -> str | None:
    """Where a file of the source is on the site, seen from docs/; None: it is not there."""
    if path.endswith(IMAGES):
        return path
    return f"{path}.txt" if path.endswith(TEXTS) else None


class Renderer:
    """Pages of documents, each in the same frame."""

    def __init__(self, documents: dict[str, Document], frame: str):
        self.documents = documents
        self.frame = frame
        self.markdown = parser()
        rules = self.markdown.renderer.rules
        rules["table_open"] = lambda *_: '<div class="table" tabindex="0"><table>\n'
        rules["table_close"] = lambda *_: "</table></div>\n"

    def link(self, document: Document, link: str) -> str | None:
        """A link as its page has it; None: nothing on the site."""
        parts = urlsplit(link)
        if parts.scheme or link.startswith("#"):
            return link
        path = path_of(document, link)
        if path not in self.documents and f"{path}/README.md" in self.documents:
            path = f"{path}/README.md"
        if path in self.documents:
            to = str(self.documents[path].page)
        elif copied := copied_name(path):
            to = str(DOCS / copied)
        else:
            return None
        return relative(document, to) + (f"#{parts.fragment}" if parts.fragment else "")

    def change(self, document: Document) -> None:
        """Makes the tokens those of the page."""
        for token in document.tokens:
            if style := token.attrGet("style"):  # of a table's cells, whose policy is stricter
                token.attrs.pop("style")
                token.attrSet("class", str(style).removeprefix("text-align:"))
            if token.type == "inline":
                token.children = self.with_links(document, token.children or [])

    def with_links(self, document: Document, tokens: list[Token]) -> list[Token]:
        result, dropped = [], False
        for token in tokens:
            if token.type == "link_open":
                to = self.link(document, str(token.attrGet("href")))
                dropped = to is None
                if to is not None:
                    token.attrSet("href", to)
            is_end = token.type in ("link_open", "link_close")
            if not (dropped and is_end):
                result.append(token)
        return result

    def navigation(self, document: Document) -> str:
        lines = []
        for other in self.documents.values():
            here = ' aria-current="page"' if other is document else ""
            level = "part" if other.place_in_list()[1] else "room"
            to = relative(document, str(other.page))
            title = html.escape(other.title)
            lines.append(f'<li class="{level}"><a href="{to}"{here}>{title}</a>')
            if other is document and other.sections:
                lines.append("<ul>")
                for place, text in other.sections:
                    lines.append(f'<li><a href="#{place}">{html.escape(text)}</a></li>')
                lines.append("</ul>")
            lines.append("</li>")
        return "<ul>\n" + "\n".join(lines) + "\n</ul>"

    def page(self, document: Document) -> str:
        self.change(document)
        texts = {
            "TITLE": html.escape(document.title),
            "HOME": relative(document, "."),
            "PAGES": self.navigation(document),
            "TEXT": self.markdown.renderer.render(document.tokens, self.markdown.options, {}),
        }
        return re.sub("@([A-Z]+)@", lambda found: texts[found[1]], self.frame)


def relative(document: Document, to: str) -> str:
    return os.path.relpath(to, document.page.parent)


def write_documents(documents: dict[str, Document], source: Path, site: Path) -> list[Path]:
    """Writes all pages, and copies what they show. Returns the pages."""
    renderer = Renderer(documents, Path(__file__).with_name("document.html").read_text("utf-8"))
    for document in documents.values():
        for path in document.links:
            copied = copied_name(path)
            if copied and not (site / DOCS / copied).exists():
                (site / DOCS / copied).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source / path, site / DOCS / copied)
        (site / document.page).parent.mkdir(parents=True, exist_ok=True)
        (site / document.page).write_text(renderer.page(document), encoding="utf-8")
    return [site / document.page for document in documents.values()]
