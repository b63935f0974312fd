import gc
import os
import sys
from pathlib import Path

import hypothesis
import pytest

# Before anything loads numpy.  Workers share the cores: threads of their own below them wait for
# each other: on a busy machine a test of half a second was not done after a minute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Every worker has a ROS domain of its own, so that tests with live nodes do not hear each other.
# Workers inherit the variables of the process that started them. Domains above 101 clash with
# ports that Linux hands out.
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 90))
worker = os.environ.get("PYTEST_XDIST_WORKER")
if worker is not None:
    os.environ["ROS_DOMAIN_ID"] = str(int(os.environ["ROS_DOMAIN_ID"]) + int(worker[2:]) % 11)

# Fixtures of several rooms, and judges that benchmarks use too.
sys.path.append(str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "bench"))
pytest_plugins = ["measured_wrist"]

# On a busy machine any example can take long.
hypothesis.settings.register_profile("any machine", deadline=None)
hypothesis.settings.load_profile("any machine")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Set aside what is loaded: after each test with live nodes the collector would look at it."""
    gc.disable()
    found = yield
    gc.freeze()
    gc.enable()
    return found


def pytest_collection_modifyitems(items):
    """Begin with what takes longest: at the end one worker would be alone with it."""
    longest = ("test_readme.py::test_commands", "test_page.py::", "test_base_fit.py::")
    items.sort(key=lambda item: not any(name in item.nodeid for name in longest))
