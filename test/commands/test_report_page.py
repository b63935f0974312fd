"""A page of a report: one file, and whatever comes in stays text."""

import base64
import os
import re
from html.parser import HTMLParser

import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.report import comparison_report
from wrist_stiffness.report.page import Bullets, Page, Picture, Table, drawn, html_of, write_page
from wrist_stiffness.report.pictures.figure import new_figure

EVIL = "<script>alert('x')</script> & \"quoted\""


class Reader(HTMLParser):
    """Collects tags, attributes and text as a browser would see them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.open, self.words = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def page(text):
    parts = (
        text,
        Bullets((text,)),
        Table(text, (text, "number"), ((text, "1.2"),)),
        Picture(b"<svg/>", text),
    )
    return Page(text, text, (text,), {text: parts})


def test_whatever_text_comes_in_stays_text():
    reader = Reader(html_of(page(EVIL)))
    assert "script" not in reader.tags
    assert reader.open == []
    # Title, heading, subtitle, verdict, section, paragraph, bullet, table (3), caption.
    assert sum(word == EVIL for word in reader.words) == 11
    assert ("alt", EVIL) in reader.attributes


def test_nothing_is_loaded_from_anywhere():
    figure = new_figure(2.0, 1.0)
    figure.subplots().plot([0, 1])
    text = html_of(Page("t", "", (), {"s": (drawn(figure, "c"),)}))
    sources = [
        value for name, value in Reader(text).attributes if name in ("src", "href", "srcset")
    ]
    assert len(sources) == 1
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    assert "url(" not in text
    assert "@import" not in text
    svg = base64.b64decode(sources[0].split(",")[1]).decode()
    # Names of XML vocabularies are never fetched; anything else would be.
    assert not re.search(r'(?:href|src)="(?!#|data:)', svg)


def test_numbers_stand_to_the_right_and_words_to_the_left():
    table = Table("", ("name", "size"), (("a", "1.25 ± 0.1"), ("b", "-3e-05"), ("c", "-")))
    text = html_of(Page("", "", (), {"": (table,)}))
    assert re.findall(r"<td( class=\"number\")?>", text) == ["", ' class="number"'] * 3


def test_the_same_page_gives_the_same_bytes():
    def once():
        figure = new_figure(2.0, 1.0)
        plot = figure.subplots()
        plot.plot([0, 1], label="a")
        plot.legend()
        return drawn(figure, "c").svg

    assert once() == once()


def test_a_name_that_is_no_text_is_shown_by_its_bytes(tmp_path):
    """As Python gives the name of a file from a machine with another encoding."""
    write_page(tmp_path / "out.html", page(os.fsdecode(b"tag_\xff")))
    assert "tag_\\udcff" in (tmp_path / "out.html").read_text(encoding="utf-8")


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match="missing/out.html"):
        write_page(tmp_path / "missing" / "out.html", page("x"))


@pytest.mark.parametrize(
    ("share", "text"),
    [(None, "-"), (0.884, "88 %"), (1.0, "100 %"), (2.39, "100 %"), (-0.2, "-20 %")],
)
def test_a_share_is_never_more_than_all(share, text):
    assert comparison_report._share(share) == text
