"""Help that teaches: every command says what it is for and shows an example that can be typed."""

import argparse
import re
import shlex
from pathlib import Path

import pytest

from wrist_stiffness.cli.main import COMMANDS, build_parser
from wrist_stiffness.cli.parser import PROG


def leaves(parser, name=()):
    """Yield (name, parser) of every command that can be run."""
    groups = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    if not groups:
        yield " ".join(name), parser
    for group in groups:
        for word, child in group.choices.items():
            yield from leaves(child, (*name, word))


PARSER = build_parser(COMMANDS)
LEAVES = dict(leaves(PARSER))


def examples(text):
    joined = re.sub(r"\\\n +", "", text)
    return re.findall(rf"^ +({PROG} .+?)(?:   .*)?$", joined, re.MULTILINE)


@pytest.mark.parametrize("name", LEAVES)
def test_help_says_what_for_and_shows_an_example(name):
    parser = LEAVES[name]
    assert len(parser.description or "") > 40
    shown = [line for line in examples(parser.epilog or "") if f" {name} " in line]
    assert shown
    for line in shown:
        arguments = PARSER.parse_args(shlex.split(line)[1:])
        assert callable(arguments.run)


@pytest.mark.parametrize("name", LEAVES)
def test_every_option_is_explained(name):
    silent = [
        action.option_strings or action.dest for action in LEAVES[name]._actions if not action.help
    ]
    assert silent == []


@pytest.mark.parametrize("name", LEAVES)
def test_every_command_has_its_section(name):
    page = Path(__file__).resolve().parents[2] / "docs/commands.md"
    assert f"\n## {name}\n" in page.read_text()
