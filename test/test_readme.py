"""Every command that the documents teach is run, and prints what they show.

`python test/test_readme.py` writes the real outputs into the documents, or into those that are
named; do that after the shipped table was built anew.  A line `...` in an output stands for lines
that are left out.
"""

import importlib.metadata
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.commands.node_list import LAUNCH_ARGUMENTS
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.planning.loads_file import read_loads
from wrist_stiffness.sessions.gauges import read_gauges
from wrist_stiffness.shipped import shipped_file

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = ("README.md", "docs/commands.md", "docs/find-the-missing-effect.md")
OUR_PROGRAM = {
    "wrist-stiffness": [sys.executable, "-m", "wrist_stiffness"],
    "python": [sys.executable],
}
TIMEOUT_S = 300.0

FENCE = re.compile(r"^```(sh|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CHECKSUM = re.compile(r"\b[0-9a-f]{12}\b")
LEFT_OUT = "..."
RELATIVE, ABSOLUTE = 0.02, 0.02
"""Numbers differ in the last digit from machine to machine; an outdated table differs by more."""


@dataclass
class Command:
    """A command of a document; `shown` is its output there, None where none is shown."""

    line: str
    shown: str | None = None


def commands_of(text):
    """Return the commands in the fenced `sh` and `console` blocks of a document."""
    commands = []
    for kind, block in FENCE.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if kind == "console" and not line.startswith("$ "):
                commands[-1].shown += line + "\n"
            elif words(line.removeprefix("$ ")):
                shown = "" if kind == "console" else None
                commands.append(Command(line.removeprefix("$ "), shown))
    return commands


def words(line):
    return shlex.split(line, comments=True)


def fault_of(command, folder):
    """Run a command in a folder, or look up what it names; return what is wrong, or nothing."""
    name, *arguments = words(command.line)
    if name in OUR_PROGRAM:
        ran = run(command, folder)
        if ran.returncode != 0:
            return f"exit code {ran.returncode}: {ran.stderr[-2000:]}"
        return "" if command.shown is None else difference(command.shown, ran.stdout)
    if name not in LOOKED_UP:
        return "no rule says how to try this command"
    missing = LOOKED_UP[name](arguments)
    return f"there is no {', no '.join(missing)}" if missing else ""


def workplace(folder):
    """Return a folder below it from which the recordings of the tests are where documents say."""
    inside = folder / "tutorial"
    if not inside.exists():
        (folder / "test").symlink_to(ROOT / "test")
        inside.mkdir()
    return inside


def run(command, folder):
    name, *arguments = words(command.line)
    if name == "wrist-stiffness" and arguments[0] != "cell":
        return run_here(arguments, folder)
    return subprocess.run(
        [*OUR_PROGRAM[name], *arguments],
        cwd=folder,
        env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def run_here(arguments, folder):
    """Run one of our commands in this process: each start of another takes two seconds."""
    out, errors = StringIO(), StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(errors):
        try:
            code = main(arguments)
        except SystemExit as wrong_use:
            code = wrong_use.code
    return subprocess.CompletedProcess(arguments, code or 0, out.getvalue(), errors.getvalue())


def difference(shown, printed):
    """Compare outputs: texts equal but for blanks, numbers within the tolerance."""
    shown, printed = plain(shown), plain(excerpt(shown, printed))
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return f"it prints\n{printed}\nand not\n{shown}"
    for old, new in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True):
        if not math.isclose(float(old), float(new), rel_tol=RELATIVE, abs_tol=ABSOLUTE):
            return f"it prints {new} and not {old} (python test/test_readme.py writes it anew)"
    return ""


def excerpt(shown, printed):
    """Leave out of an output what a document leaves out of it."""
    if LEFT_OUT not in shown.splitlines():
        return printed
    kept, rest = [], printed.splitlines()
    for line in shown.splitlines():
        if line == LEFT_OUT:
            kept.append(line)
            continue
        wanted = form(line)
        while rest and form(rest[0]) != wanted and kept[-1:] == [LEFT_OUT]:
            rest.pop(0)
        kept += rest[:1]
        rest = rest[1:]
    return "\n".join(kept if kept[-1:] == [LEFT_OUT] else [*kept, *rest])


def form(line):
    return NUMBER.sub("#", plain(line))


def plain(output):
    output = CHECKSUM.sub("CHECKSUM", output.replace(str(ROOT), "..."))
    return "\n".join(" ".join(line.split()) for line in output.strip().splitlines())


def missing_targets(arguments):
    makefile = (ROOT / "Makefile").read_text()
    targets = [word for word in arguments if "=" not in word]
    return [f"target {t}" for t in targets if not re.search(rf"^{t}:", makefile, re.MULTILINE)]


def missing_extras(arguments):
    known = importlib.metadata.metadata("wrist_stiffness").get_all("Provides-Extra")
    wanted = [extra for a in arguments for extra in "".join(re.findall(r"\[(.*)\]", a)).split(",")]
    return [f"extra {extra}" for extra in wanted if extra and extra not in known]


def missing_packages(arguments):
    named = arguments[arguments.index("--packages-select") + 1 :]
    package = (ROOT / "package.xml").read_text()
    return [f"package {name}" for name in named if f"<name>{name}</name>" not in package]


def missing_of_ros(arguments):
    verb, *named = arguments
    if verb == "launch":
        _, file, *settings = named
        known = (ROOT / "launch" / file).is_file()
        unknown = {each.split(":=")[0] for each in settings} - LAUNCH_ARGUMENTS.keys()
        return [] if known and not unknown else [f"launch {named}"]
    if verb == "run":
        scripts = importlib.metadata.entry_points(group="console_scripts")
        return [] if named[1] in scripts.names else [f"executable {named[1]}"]
    _, what, *_ = named
    node, _, service = what.strip("/").rpartition("/")
    sources = "".join(path.read_text() for path in (ROOT / "wrist_stiffness/ros").glob("*.py"))
    named = [service.removesuffix("_all"), *([node] if node else [])]
    return [] if all(f'"{each}"' in sources for each in named) else [f"{verb} {what}"]


LOOKED_UP = {
    "make": missing_targets,
    "pip": missing_extras,
    "colcon": missing_packages,
    "ros2": missing_of_ros,
    # They prepare a shell.
    "source": lambda arguments: [],
    ".": lambda arguments: [],
}


@pytest.mark.slow
@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_of_the_document_run_and_print_what_it_shows(document, tmp_path):
    pytest.importorskip("rclpy", reason="the documents start live nodes")
    commands = commands_of((ROOT / document).read_text())
    assert len(commands) > 5
    for command in commands:
        fault = fault_of(command, workplace(tmp_path))
        assert not fault, f"{document}: {command.line}\n{fault}"


@pytest.mark.parametrize(
    ("block", "fault"),
    [
        ("```sh\nmake demo test\n```\n", ""),
        ("```sh\nmake coffee\n```\n", "target coffee"),
        ("```sh\npip install -e '.[ros,fem]'\n```\n", ""),
        ("```sh\npip install '.[ros,tea]'\n```\n", "extra tea"),
        ("```sh\ncolcon build --packages-select wrist\n```\n", "package wrist"),
        ("```sh\nros2 launch wrist_stiffness wrist.launch.py cell:=true\n```\n", ""),
        ("```sh\nros2 launch wrist_stiffness wrist.launch.py cat:=true\n```\n", "cat:=true"),
        ("```sh\nros2 run wrist_stiffness pose_error_predictor\n```\n", ""),
        ("```sh\nros2 run wrist_stiffness coffee\n```\n", "executable coffee"),
        ("```sh\nros2 service call /angle_corrector/enable T V\n```\n", ""),
        ("```sh\nros2 service call /angle_corrector/disable T V\n```\n", "disable"),
        ("```sh\nrm -rf x\n```\n", "no rule"),
        ("```sh\nwrist-stiffness --version  # the version\n```\n", ""),
        ("```sh\nwrist-stiffness brew\n```\n", "exit code 2"),
        ("```console\n$ python -c 'print(\"s  8.73 um\")'\ns 8.74 um\n```\n", ""),
        ("```console\n$ python -c 'print(\"s 8.73 um\")'\ns 9.73 um\n```\n", "8.73 and not 9.73"),
        ("```console\n$ python -c 'print(\"s 8.73 um\")'\ns 8.73 mm\n```\n", "and not"),
        ("```console\n$ python -c 'print(\"s 8.73 um\")'\n```\n", "and not"),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\n...\nb 1\n...\n```\n", ""),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\na\n...\nc\n```\n", ""),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\n...\nb 2\n...\n```\n", "prints 1"),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\n...\nd 1\n...\n```\n", "and not"),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\n...\nb 1\n```\n", "and not"),
        ("```console\n$ python -c 'print(\"a\\nb 1\\nc\")'\nb 1\n...\n```\n", "and not"),
    ],
)
def test_a_wrong_document_is_found(block, fault, tmp_path):
    (command,) = commands_of(block)
    found = fault_of(command, tmp_path)
    assert (fault in found) if fault else found == ""


def test_files_of_the_document_can_be_read(tmp_path):
    shutil.copy(shipped_file("precomputed/palmieri2015.npz"), tmp_path / "my_wrist.npz")
    examples = re.findall(
        r"^```yaml\n(.*?)^```$", (ROOT / "docs/files.md").read_text(), re.M | re.S
    )
    assert examples
    for number, example in enumerate(examples):
        path = tmp_path / f"example_{number}.yaml"
        path.write_text(example)
        if "\nloads:" in example:
            assert read_loads(path, np.array([0.0, 0.0, -9.81]), force_limit=5.0)
        elif "\ngauges:" in example:
            assert read_gauges(path)
        else:
            assert load_model(path).effects


def test_tables_of_the_document_can_be_imported(tmp_path):
    tables = re.findall(
        r"^```text\n(time_s.*?)^```$", (ROOT / "docs/files.md").read_text(), re.M | re.S
    )
    (yaml,) = re.findall(
        r"^```yaml\n(schema: 1\ngauges.*?)^```$", (ROOT / "docs/files.md").read_text(), re.M | re.S
    )
    gauges = tmp_path / "gauges.yaml"
    gauges.write_text(yaml)
    assert len(tables) == 4
    for number, table in enumerate(tables):
        path = tmp_path / "table.csv"
        path.write_text(table)
        described = gauges if "level_mdeg" in table else None
        imported = import_csv(
            path, tmp_path / f"{number}.mcap", "fx_N" not in table, gauges_file=described
        )
        assert imported.measured == imported.rows == table.count("\n") - 1


PAGES = sorted(
    str(page.relative_to(ROOT))
    for pattern in ("*.md", "docs/*.md", "bench/*.md")
    for page in ROOT.glob(pattern)
)
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


def anchors_of(page):
    """Return the names of the headings of a page, as GitHub makes them."""
    titles = HEADING.findall(re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S))
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("document", PAGES)
def test_links_lead_somewhere(document):
    path = ROOT / document
    for file, anchor in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", path.read_text()):
        page = path.parent / file if file else path
        assert page.exists(), file
        assert not anchor or anchor in anchors_of(page), f"{file}#{anchor}"


def write_outputs(document):
    """Put the real outputs into the `console` blocks of a document."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = workplace(Path(temporary))

        def filled(match):
            kind, block = match.groups()
            lines = []
            for command in commands_of(match.group(0)):
                is_ours = words(command.line)[0] in OUR_PROGRAM
                output = run(command, folder).stdout if is_ours else ""
                output = excerpt(command.shown or "", output)
                lines += [f"$ {command.line}", *output.replace(str(ROOT), "...").splitlines()]
            return match.group(0) if kind == "sh" else "\n".join(["```console", *lines, "```"])

        path = ROOT / document
        path.write_text(FENCE.sub(filled, path.read_text()))


if __name__ == "__main__":
    for name in sys.argv[1:] or DOCUMENTS:
        write_outputs(name)
