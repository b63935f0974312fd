"""A report as an HTML page in one file, for screen, phone and paper, or as lines of a terminal."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from wrist_stiffness.atomic_file import writing

if TYPE_CHECKING:
    from wrist_stiffness.commands.provenance import Provenance

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
pre { background: #f3f3f3; padding: 0.6rem 1rem; font-size: 0.9rem; white-space: pre-wrap; }
@media print { body { max-width: none; font-size: 11pt; padding: 0; } .wide { overflow: visible; }
  tr { break-inside: avoid; } h2 { break-after: avoid; } }
"""

# The page may load nothing from anywhere, whatever text gets into it.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

NUMBER = re.compile(r"(\+-|[-+±])?\d[\d.,]*(e[-+]?\d+)?( (±|\+-) [\d.]+)?( %| s)?|[-–]?")

SIGNS = {r"\bum\b": "µm", r"\+-": "±", r"\bdegC\b": "°C", r" deg/s\b": " °/s"}
"""What texts have in ASCII, for terminals."""


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head, with one sentence above."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def numeric(self) -> list[bool]:
        """Whether a column holds numbers, which stand to the right."""
        columns = zip(*self.rows, strict=True) if self.rows else ((),) * len(self.head)
        return [bool(column) and all(map(NUMBER.fullmatch, column)) for column in columns]

    def lines(self) -> list[str]:
        """Return head and rows for a terminal, columns as wide as they must be."""
        rows = [self.head, *self.rows]
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        sides = [f"{'>' if each else '<'}{n}" for each, n in zip(self.numeric, wide, strict=True)]
        return [
            "  ".join(f"{cell:{side}}" for cell, side in zip(row, sides, strict=True)).rstrip()
            for row in rows
        ]


@dataclass(frozen=True)
class Command:
    """What can be typed into a terminal."""

    text: str


@dataclass(frozen=True)
class Picture:
    """A drawing as SVG with one sentence below."""

    svg: bytes
    caption: str


Part: TypeAlias = str | Bullets | Table | Command | Picture
"""Of a section; a text is a paragraph."""

Sections: TypeAlias = Mapping[str, Sequence[Part]]
"""Parts by their heading, in the order in which they are read; one without parts is left out."""


@dataclass(frozen=True)
class Page:
    """A report."""

    # `title`, `subtitle`: what it is about
    title: str
    subtitle: str
    verdict: Sequence[str]  # the answer in a few sentences, before everything else
    sections: Sections


def drawn(figure: Any, caption: str) -> Picture:
    """Turn a matplotlib figure into a picture; the same figure gives the same bytes."""
    from matplotlib import rc_context

    buffer = BytesIO()
    with rc_context({"svg.hashsalt": "wrist_stiffness"}):
        figure.savefig(buffer, format="svg", dpi=150, metadata={"Date": None})
    return Picture(buffer.getvalue(), caption)


def lines_of(sections: Sections) -> list[str]:
    """Return sections for a terminal, without their pictures."""
    out = []
    for heading, parts in sections.items():
        out += ["", heading] if parts else []
        for part in parts:
            if isinstance(part, str):
                out.append(f"  {part}")
            elif isinstance(part, Bullets):
                out += [f"  - {item}" for item in part.items]
            elif isinstance(part, Table):
                out += [f"  {line}" for line in (part.caption, *part.lines())]
    return out


def html_of(page: Page) -> str:
    """Return the page as one HTML text that needs no other file."""
    sections = "\n".join(
        f"<section><h2>{_text(heading)}</h2>\n" + "\n".join(map(_html, parts)) + "</section>"
        for heading, parts in page.sections.items()
        if parts
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(page.title)}</title>\n<style>{STYLE}</style></head>\n<body>\n"
        f'<h1>{_text(page.title)}</h1>\n<p class="subtitle">{_text(page.subtitle)}</p>\n'
        f'<div class="verdict">{_each("p", page.verdict)}</div>\n{sections}\n</body></html>\n'
    )


def write_page(path: str | Path, page: Page) -> None:
    """Write a page, complete or not at all (InputError if that fails)."""
    with writing(path) as written:
        # A file's name may be no text: its bytes are shown by their numbers.
        written.write_text(html_of(page), encoding="utf-8", errors="backslashreplace")


def _html(part: Part) -> str:
    if isinstance(part, str):
        return _each("p", [part])
    if isinstance(part, Command):
        return f"<pre>{escape(part.text)}</pre>"
    if isinstance(part, Bullets):
        return f"<ul>{_each('li', part.items)}</ul>"
    caption = _text(part.caption)
    if isinstance(part, Picture):
        data = base64.b64encode(part.svg).decode("ascii")
        return (
            f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{caption}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )
    classes = [' class="number"' if each else "" for each in part.numeric]
    head, *body = (
        "".join(f"<{tag}{c}>{_text(cell)}</{tag}>" for cell, c in zip(row, classes, strict=True))
        for tag, row in [("th", part.head), *(("td", row) for row in part.rows)]
    )
    rows = "".join(f"<tr>{row}</tr>" for row in body)
    return (
        f'<div class="wide"><table><caption>{caption}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _each(tag: str, texts: Iterable[str]) -> str:
    return "".join(f"<{tag}>{_text(text)}</{tag}>" for text in texts)


def _text(text: str) -> str:
    return escape(typeset(text))


def typeset(text: str) -> str:
    """Return a text with the signs that a page or a picture has."""
    for plain, sign in SIGNS.items():
        text = re.sub(plain, sign, text)
    return text


def title(key: str) -> str:
    """Return the title of a column by the key of its quantity: of s_um it is s [um]."""
    name, _, unit = key.rpartition("_")
    return f"{name} [{unit}]"


def provenance_section(provenance: Provenance) -> Sections:
    """Return where the result comes from."""
    files = [("model", *each) for each in provenance.models.items()]
    files += [("recording", *each) for each in provenance.recordings.items()]
    rows = [(kind, name, sha[:16]) for kind, name, sha in files]
    caption = "Files, with the first digits of their checksums."
    return {
        "Files and versions": (
            f"Made on {provenance.date} by: {provenance.command}",
            Table(caption, ("kind", "file", "SHA-256"), rows),
            Table("Versions", ("package", "version"), list(provenance.versions.items())),
        )
    }
