import ast
import sys
from pathlib import Path

import pytest

PACKAGE = "wrist_stiffness"
SOURCE = Path(__file__).parents[1] / PACKAGE

ONLINE = {"mechanism", "lookup", "model"}
MEASURED = ONLINE | {"sessions", "inference"}
STATISTICS = MEASURED | {"identification", "comparing", "planning"}
CORE = STATISTICS | {"fem", "compensation", "recording", "simulation"}
ROOMS_USED = {
    "mechanism": set(),
    "lookup": {"mechanism"},
    "fem": {"mechanism", "lookup"},
    "model": {"mechanism", "lookup"},
    "compensation": ONLINE,
    "inference": set(),
    "sessions": ONLINE | {"compensation", "inference", "recording"},
    "identification": MEASURED,
    "comparing": MEASURED | {"identification", "compensation"},
    "planning": MEASURED | {"compensation"},
    "recording": set(),
    "simulation": {"mechanism", "lookup", "recording"},
    "analysis": CORE,
    "report": CORE | {"commands"},
    "commands": CORE | {"analysis", "shipped"},
    "web": CORE | {"analysis", "commands", "report", "shipped"},
    "cli": CORE | {"commands", "report", "shipped", "web"},
    "ros": CORE | {"commands", "shipped"},
    "errors": set(),
    "progress": set(),
    "numerals": set(),
    "atomic_file": set(),
    "inputs": set(),
    "shipped": set(),
    "topics": set(),
    "__main__": {"cli"},
    "__init__": set(),
}
COMMON = {"errors", "atomic_file", "inputs", "numerals", "progress", "topics"}
ROBOT = {"numpy", "scipy", "yaml", "mcap"}
LIBRARIES_USED = {
    "recording": ROBOT | {"lz4", "zstandard"},  # mcap depends on both
    "fem": ROBOT | {"netgen", "skfem", "pymetis"},
    "cli": ROBOT | {"tqdm"},  # the extra `progress`
    "ros": ROBOT | {"rclpy", "builtin_interfaces"},
    # the extra `web`; Starlette and Plotly's JavaScript come with it
    "web": ROBOT | {"nicegui", "starlette"},
}
DRAWING = "matplotlib"


def imports(node, inside=False):
    """Yield (dotted name, is inside a function) of every import below a node."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from ((alias.name, inside) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            base = f"{'.' * child.level}{child.module or ''}"
            # The imported name may be a room: `from wrist_stiffness import fem`.
            yield from ((f"{base}.{alias.name}", inside) for alias in child.names)
        yield from imports(child, inside or isinstance(child, ast.FunctionDef | ast.Lambda))


def violations(module, text):
    """Return what a module (path below the package) imports against the rules."""
    room = Path(module).parts[0].removesuffix(".py")
    found = []
    for name, inside in imports(ast.parse(text)):
        first, second = (name.split(".") + [""])[:2]
        if first == "":
            found.append(f"{module}: relative import {name}")
        elif first == PACKAGE:
            if second in ROOMS_USED and second not in ROOMS_USED[room] | COMMON | {room}:
                found.append(f"{module}: {room} uses {second}")
        elif first == DRAWING:
            if not (room == "report" and inside) and Path(module).stem != "plotting":
                found.append(f"{module}: imports {first} outside a function of report")
        elif first not in LIBRARIES_USED.get(room, ROBOT) | sys.stdlib_module_names and not (
            room == "ros" and first.endswith(("_msgs", "_srvs", "_interfaces"))
        ):
            found.append(f"{module}: {room} uses {first}")
    return found


def test_every_module_keeps_to_the_import_directions():
    modules = sorted(SOURCE.rglob("*.py"))
    assert modules
    found = []
    for path in modules:
        found += violations(str(path.relative_to(SOURCE)), path.read_text())
    assert sorted(set(found)) == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("mechanism/arm.py", "from wrist_stiffness.lookup import spline"),
        ("mechanism/arm.py", "from wrist_stiffness import lookup"),
        ("mechanism/arm.py", "from ..lookup import spline"),
        ("mechanism/arm.py", "def f():\n    import wrist_stiffness.cli.main"),
        ("mechanism/arm.py", "class A:\n    def f(self):\n        import rclpy"),
        ("lookup/arm.py", "if True:\n    from geometry_msgs.msg import Wrench"),
        ("lookup/arm.py", "import skfem"),
        ("recording/arm.py", "from wrist_stiffness.mechanism import geometry"),
        ("cli/arm.py", "import rclpy"),
        ("report/arm.py", "import matplotlib.pyplot as plt"),
        ("cli/arm.py", "def f():\n    import matplotlib"),
    ],
)
def test_planted_violation_is_found(module, line):
    assert violations(module, line)


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("lookup/arm.py", "from wrist_stiffness.errors import TableError\nimport json, numpy"),
        ("fem/arm.py", "from netgen.occ import Cylinder\nfrom wrist_stiffness import __version__"),
        ("ros/arm.py", "import rclpy\nfrom std_srvs.srv import Trigger"),
        ("report/arm.py", "def f():\n    if 1:\n        import matplotlib.pyplot as plt"),
    ],
)
def test_permitted_import_is_not_reported(module, line):
    assert violations(module, line) == []


def test_every_room_has_a_rule():
    rooms = {path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}
    assert {room.removesuffix(".py") for room in rooms} <= ROOMS_USED.keys()
