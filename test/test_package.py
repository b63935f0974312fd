import ast
import configparser
import os
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

import pytest

import wrist_stiffness
from wrist_stiffness import shipped
from wrist_stiffness.cli.main import COMMANDS, build_parser
from wrist_stiffness.commands.node_list import SIMULATOR_NODE, WRIST_NODES, NodeEntry
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file

ROOT = Path(__file__).parents[1]
PROBE = "config/probe.yaml"
ASK = f"""
import wrist_stiffness
from wrist_stiffness.shipped import shipped_file
print(wrist_stiffness.__file__)
print(shipped_file({PROBE!r}))
"""


def run(*arguments, cwd, **environment):
    """Run a program with nothing of the source tree on its path."""
    inherited = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "COLCON_LOG_PATH")}
    ran = subprocess.run(
        list(map(str, arguments)),
        cwd=cwd,
        env=inherited | environment,
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def modules(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*.py")}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Return a copy of what is installed, with one more file in config/."""
    copy = tmp_path_factory.mktemp("source") / "wrist_stiffness"
    shutil.copytree(
        ROOT,
        copy,
        ignore=lambda folder, names: (
            set(names)
            - {"setup.py", "setup.cfg", "pyproject.toml", "package.xml", "colcon.pkg", "LICENSE"}
            - {"resource", "launch", "config", "precomputed", "wrist_stiffness"}
            if Path(folder) == ROOT
            else {"__pycache__"} & set(names)
        ),
    )
    (copy / "config").mkdir(exist_ok=True)
    (copy / PROBE).write_text("probe: 1\n")
    return copy


def test_version_is_the_same_everywhere():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert package.findtext("name") == wrist_stiffness.__name__
    assert package.findtext("version") == wrist_stiffness.__version__
    assert package.findtext("license") == "Apache-2.0"


def test_message_packages_that_the_code_imports_are_declared():
    declared = {entry.text for entry in ElementTree.parse(ROOT / "package.xml").iter("exec_depend")}
    text = "\n".join(path.read_text() for path in (ROOT / "wrist_stiffness/ros").rglob("*.py"))
    imported = set(re.findall(r"^\s*(?:from|import) (rclpy|\w+_(?:msgs|srvs))\b", text, re.M))
    assert imported <= declared


def test_every_console_script_names_a_function_that_exists(source):
    run(sys.executable, "setup.py", "-q", "egg_info", cwd=source)
    scripts = configparser.ConfigParser()
    scripts.optionxform = str
    scripts.read(source / "wrist_stiffness.egg-info/entry_points.txt")
    assert set(scripts["console_scripts"]) == {
        "wrist-stiffness",
        *(entry.name for entry in (*WRIST_NODES, SIMULATOR_NODE)),
    }
    for target in scripts["console_scripts"].values():
        module, function = target.split(":")
        tree = ast.parse((source / f"{module.replace('.', '/')}.py").read_text())
        made = [node.targets[0].id for node in tree.body if isinstance(node, ast.Assign)]
        names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert function in names.union(made), target


def test_every_folder_of_the_package_is_a_package():
    folders = {path.parent for path in (ROOT / "wrist_stiffness").rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").is_file()] == []


def test_shipped_file_of_the_source_tree(source):
    module_file, found = run(
        sys.executable, "-P", "-c", ASK, cwd="/", PYTHONPATH=str(source)
    ).split()
    assert Path(module_file).parent.parent == source
    assert Path(found) == source / PROBE


def test_make_tables_builds_the_shipped_tables_and_each_can_be_loaded():
    parser, makefile = build_parser(COMMANDS), (ROOT / "Makefile").read_text()
    lines = re.findall(r"\$\(RUN\) wrist_stiffness (table build .*)", makefile)
    built = {parser.parse_args(shlex.split(line)).output for line in lines}
    assert built == {str(path.relative_to(ROOT)) for path in ROOT.glob("precomputed/*")}
    for each in built:
        load_table(ROOT / each)


def test_missing_shipped_file_says_where_it_was_looked_for(tmp_path, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}{os.pathsep}/opt/other")
    with pytest.raises(InputError) as caught:
        shipped_file("config/nothing.yaml")
    message = str(caught.value)
    assert "config/nothing.yaml" in message
    for folder in (ROOT, f"{sys.prefix}/share/wrist_stiffness", "/opt/other/share/wrist_stiffness"):
        assert str(folder) in message


def test_shipped_file_of_another_ament_prefix(tmp_path, monkeypatch):
    share = tmp_path / "share" / shipped.PACKAGE
    (share / "config").mkdir(parents=True)
    (share / PROBE).touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere{os.pathsep}{tmp_path}")
    assert shipped_file(PROBE) == share / PROBE


@pytest.mark.slow
def test_pip_installs_commands_and_shipped_files(source, tmp_path):
    pip = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "install")
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed")
    run(*pip, *options, "--prefix", tmp_path, source, cwd="/")
    assert {path.name for path in (tmp_path / "bin").iterdir()} == {
        "wrist-stiffness",
        *(entry.name for entry in (*WRIST_NODES, SIMULATOR_NODE)),
    }
    (site,) = tmp_path.glob("lib/python*/site-packages")
    assert modules(site / "wrist_stiffness") == modules(source / "wrist_stiffness")
    module_file, found = run(sys.executable, "-P", "-c", ASK, cwd="/", PYTHONPATH=str(site)).split()
    assert Path(module_file).is_relative_to(site)
    assert Path(found) == tmp_path / "share/wrist_stiffness" / PROBE
    version = run(tmp_path / "bin/wrist-stiffness", "--version", cwd="/", PYTHONPATH=str(site))
    assert version == f"wrist-stiffness {wrist_stiffness.__version__}\n"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("colcon_core") is None, reason="colcon is not installed")
@pytest.mark.parametrize("options", [(), ("--symlink-install",)], ids=["copied", "symlinked"])
def test_colcon_installs_executables_and_shipped_files(source, tmp_path, options):
    colcon = Path(sys.executable).with_name("colcon")
    run(
        *(colcon, "--log-base", tmp_path / "log", "build", *options),
        *("--base-paths", source, "--build-base", tmp_path / "build"),
        *("--install-base", tmp_path / "install"),
        cwd=tmp_path,
        AMENT_PREFIX_PATH=sys.prefix,
    )
    prefix = tmp_path / "install/wrist_stiffness"
    assert {path.name for path in (prefix / "lib/wrist_stiffness").iterdir()} == {
        "wrist-stiffness",
        *(entry.name for entry in (*WRIST_NODES, SIMULATOR_NODE)),
    }
    share = prefix / "share"
    assert (share / "ament_index/resource_index/packages/wrist_stiffness").is_file()
    assert (share / "wrist_stiffness/launch/wrist.launch.py").is_file()
    setup = f'. {tmp_path}/install/local_setup.sh && exec "$@"'
    in_workspace = ("sh", "-c", setup, "sh")
    module_file, found = run(*in_workspace, sys.executable, "-P", "-c", ASK, cwd="/").split()
    assert Path(module_file).is_relative_to(tmp_path)
    assert Path(found).samefile(share / "wrist_stiffness" / PROBE)
    version = run(*in_workspace, "wrist-stiffness", "--version", cwd="/")
    assert version == f"wrist-stiffness {wrist_stiffness.__version__}\n"


def test_launch_file_starts_the_node_list():
    path = ROOT / "launch/wrist.launch.py"
    tree = ast.parse(path.read_text())
    compile(tree, path, "exec")
    (imported,) = (
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "wrist_stiffness.commands.node_list"
    )
    names = {alias.name for alias in imported.names}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert {"WRIST_NODES", "SIMULATOR_NODE", "LAUNCH_ARGUMENTS"} <= names <= used
    attributes = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "entry"
    }
    assert attributes == {field.name for field in fields(NodeEntry)}


def test_node_entry_becomes_a_command():
    entry = NodeEntry(
        name="angle_corrector",
        parameters={"enabled_on_start": True, "rate_hz": 1.5},
    )
    python, *rest = entry.command()
    assert python == sys.executable
    assert " ".join(rest) == (
        "-m wrist_stiffness.ros.start angle_corrector --ros-args -r __node:=angle_corrector "
        "-p enabled_on_start:=true -p rate_hz:=1.5"
    )
