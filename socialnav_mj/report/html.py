"""Pages as one HTML file each that needs nothing else: styles, figures and the sorting script are in it.

Pages are written in Markdown, with `blocks.Table` where a table knows more than its text. Nothing of a page can run or
load: Markdown's HTML is off, Jinja escapes, and the page's own policy names the scripts that may run by their hash.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from socialnav_mj.report.blocks import Row, Table, cell_of
from socialnav_mj.resources import assets_folder

_WARNING = "Warning"
"""What a paragraph that warns begins with, in bold."""
_SCRIPTS = ("sortable.js", "sortable.a11y.js")


@dataclass(frozen=True, kw_only=True)
class Page:
    """What the template fills in."""

    title: str
    warnings: tuple[Markup, ...]
    sections: tuple[tuple[str, str], ...]
    """Heading and anchor of each section."""
    blocks: tuple[Markup | Table, ...]


def html_page(blocks: Iterable[str | Table], folder: Path) -> bytes:
    """A page as HTML.

    Args:
        blocks: Markdown, whose first heading is the title, and tables. Paragraphs that begin with **Warning** come
            first.
        folder: Where the page will be; figures that the Markdown shows are put into the page from there, as the SVG
            beside a PNG if there is one.

    Returns:
        UTF-8; equal bytes for equal blocks and figures.
    """
    assets = assets_folder() / "report"
    scripts = [Markup((assets / name).read_text(encoding="utf-8")) for name in _SCRIPTS]
    environment = Environment(
        loader=FileSystemLoader(assets), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    text = environment.get_template("page.html.j2").render(
        page=_page(blocks, folder),
        css=Markup((assets / "page.css").read_text(encoding="utf-8")),
        scripts=scripts,
        policy=_policy(scripts),
    )
    return text.encode()


def _policy(scripts: Sequence[str]) -> str:
    """Nothing from elsewhere, and no script but ours."""
    sums = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {sums}; base-uri 'none'"


def _page(blocks: Iterable[str | Table], folder: Path) -> Page:
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    title, warnings, sections, shown = "", list[Markup](), list[tuple[str, str]](), list[Markup | Table]()
    for block in blocks:
        if isinstance(block, Table):
            shown.append(block)
            continue
        for part in _parts(parser.parse(block)):
            first = part[0]
            if first.type == "table_open":
                shown.append(_table(parser, part))
                continue
            _put_figures_in(part, folder)
            if first.type == "heading_open" and first.tag == "h1" and not title:
                title = _text(part[1])
                continue
            if first.type == "heading_open" and first.tag == "h2":
                first.attrSet("id", f"section-{len(sections) + 1}")
                sections.append((_text(part[1]), str(first.attrGet("id"))))
            rendered = Markup(parser.renderer.render(part, parser.options, {}))
            (warnings if first.type == "paragraph_open" and _warns(part[1]) else shown).append(rendered)
    return Page(title=title, warnings=tuple(warnings), sections=tuple(sections), blocks=tuple(shown))


def _parts(tokens: Sequence[Token]) -> Iterable[list[Token]]:
    """Paragraphs, headings, lists and tables, one at a time."""
    part: list[Token] = []
    depth = 0
    for token in tokens:
        part.append(token)
        depth += token.nesting
        if depth == 0:
            yield part
            part = []


def _warns(inline: Token) -> bool:
    children = [child for child in inline.children or () if child.type != "text" or child.content]
    return len(children) > 1 and children[0].type == "strong_open" and children[1].content == _WARNING


def _table(parser: MarkdownIt, tokens: Sequence[Token]) -> Table:
    rows: list[list[Token]] = []
    for token in tokens:
        if token.type == "tr_open":
            rows.append([])
        elif token.type == "inline":
            rows[-1].append(token)

    def shown(inline: Token) -> Markup:
        return Markup(parser.renderer.render([inline], parser.options, {}))

    return Table(
        headings=tuple(_text(token) for token in rows[0]),
        rows=tuple(Row(cells=tuple(cell_of(_text(token), shown(token)) for token in row)) for row in rows[1:]),
    )


def _text(inline: Token) -> str:
    return "".join(child.content for child in inline.children or () if child.type in {"text", "code_inline"})


def _put_figures_in(tokens: Sequence[Token], folder: Path) -> None:
    for token in tokens:
        for child in token.children or ():
            if child.type == "image":
                child.attrSet("src", _figure(folder, str(child.attrGet("src"))))
            elif child.type == "link_open":
                child.attrSet("href", _page_of(str(child.attrGet("href"))))


def _figure(folder: Path, name: str) -> str:
    """A picture as an address that holds it; scripts in such a picture do not run."""
    path = (folder / name).with_suffix(".svg")
    if not path.resolve().is_relative_to(folder.resolve()) or not path.is_file():
        return "data:,"
    return f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"


def _page_of(link: str) -> str:
    """Of two pages beside each other, each links to the other's HTML."""
    beside = "/" not in link and link.endswith(".md")
    return f"{link.removesuffix('.md')}.html" if beside else link
