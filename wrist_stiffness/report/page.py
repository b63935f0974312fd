"""An HTML page in one file: text, tables and pictures, for screen, phone and paper."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

from wrist_stiffness.atomic_file import writing

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 60rem; margin: 0 auto; padding: 1rem; overflow-wrap: break-word; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0.5rem 0; }
h2 { font-size: 1.2rem; margin: 2rem 0 0.5rem; border-bottom: 1px solid #ccc; }
.subtitle { color: #555; margin: 0; }
.verdict { border-left: 0.4rem solid #0072b2; background: #eef5fa; padding: 0.6rem 1rem;
  margin: 1rem 0; font-size: 1.1rem; }
.verdict p { margin: 0.2rem 0; }
figure { margin: 1rem 0; break-inside: avoid; }
figure img { max-width: 100%; height: auto; }
figcaption, caption { color: #444; font-size: 0.9rem; text-align: left; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; }
caption { padding-bottom: 0.3rem; break-after: avoid; }
th, td { border-bottom: 1px solid #ddd; padding: 0.25rem 0.6rem; text-align: left;
  vertical-align: top; }
th { border-bottom: 2px solid #888; }
.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
li { margin: 0.3rem 0; }
@media print { body { max-width: none; font-size: 11pt; padding: 0; } .wide { overflow: visible; }
  tr { break-inside: avoid; } h2 { break-after: avoid; } }
"""

# The page may load nothing from anywhere, whatever text gets into it.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

NUMBER = re.compile(r"[-+±]?\d[\d.,]*(e[-+]?\d+)?( ± [\d.]+)?( %| s)?|[-–]?")


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head, with one sentence above."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A drawing as SVG with one sentence below."""

    svg: bytes
    caption: str


Part = Text | Bullets | Table | Picture


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it."""

    heading: str
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Page:
    """A report."""

    # `title`, `subtitle`: what it is about
    title: str
    subtitle: str
    verdict: tuple[str, ...]  # the answer in a few sentences, before everything else
    sections: tuple[Section, ...]  # in the order in which they are read


def drawn(figure: Any, caption: str) -> Picture:
    """Turn a matplotlib figure into a picture; the same figure gives the same bytes."""
    from matplotlib import rc_context

    buffer = BytesIO()
    with rc_context({"svg.hashsalt": "wrist_stiffness"}):
        figure.savefig(buffer, format="svg", dpi=150, metadata={"Date": None})
    return Picture(buffer.getvalue(), caption)


def html_of(page: Page) -> str:
    """Return the page as one HTML text that needs no other file."""
    verdict = "".join(f"<p>{escape(line)}</p>" for line in page.verdict)
    sections = "\n".join(
        f"<section><h2>{escape(section.heading)}</h2>\n"
        + "\n".join(_part(part) for part in section.parts)
        + "</section>"
        for section in page.sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(page.title)}</title>\n<style>{STYLE}</style></head>\n<body>\n"
        f'<h1>{escape(page.title)}</h1>\n<p class="subtitle">{escape(page.subtitle)}</p>\n'
        f'<div class="verdict">{verdict}</div>\n{sections}\n</body></html>\n'
    )


def write_page(path: str | Path, page: Page) -> None:
    """Write a page, complete or not at all (InputError if that fails)."""
    with writing(path) as written:
        # A file's name may be no text: its bytes are shown by their numbers.
        written.write_text(html_of(page), encoding="utf-8", errors="backslashreplace")


def _part(part: Part) -> str:
    if isinstance(part, Text):
        return f"<p>{escape(part.text)}</p>"
    if isinstance(part, Bullets):
        return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in part.items) + "</ul>"
    if isinstance(part, Picture):
        data = base64.b64encode(part.svg).decode("ascii")
        caption = escape(part.caption)
        return (
            f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{caption}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )
    return _table(part)


def _table(table: Table) -> str:
    numeric = [
        bool(table.rows) and all(NUMBER.fullmatch(row[column]) for row in table.rows)
        for column in range(len(table.head))
    ]

    def cells(row: tuple[str, ...], tag: str) -> str:
        return "".join(
            f"<{tag}{' class=' + chr(34) + 'number' + chr(34) if is_number else ''}>"
            f"{escape(cell)}</{tag}>"
            for cell, is_number in zip(row, numeric, strict=True)
        )

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in table.rows)
    return (
        f'<div class="wide"><table><caption>{escape(table.caption)}</caption>'
        f"<thead><tr>{cells(table.head, 'th')}</tr></thead><tbody>{body}</tbody></table></div>"
    )
