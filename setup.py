"""Installs the package with pip or colcon (ament_python)."""

import re
from pathlib import Path

from setuptools import Extension, find_packages, setup

NAME = "wrist_stiffness"
HERE = Path(__file__).parent
VERSION = re.findall(r'__version__ = "(.+)"', (HERE / NAME / "__init__.py").read_text())[0]
NODES = ("pose_error_predictor", "angle_corrector", "model_monitor", "cell_simulator")


def shared(pattern: str) -> tuple[str, list[str]]:
    """Return a data_files entry that puts the files of one folder under share/."""
    files = sorted(str(path.relative_to(HERE)) for path in HERE.glob(pattern))
    return f"share/{NAME}/{Path(pattern).parent}", files


def compiled(room: str, name: str) -> Extension:
    """Return the C of a room as an extension module.

    Without a C compiler the package installs all the same and runs without it, slower.  The stable
    interface makes one build serve every Python; no fused multiply-add, so that all processors
    round alike.
    """
    folder = HERE / NAME / room / "native"
    return Extension(
        f"{NAME}.{room}.{name}",
        sorted(str(path.relative_to(HERE)) for path in folder.glob("*.c")),
        depends=[str(path.relative_to(HERE)) for path in folder.glob("*.h")],
        define_macros=[("Py_LIMITED_API", "0x030B0000")],
        py_limited_api=True,
        extra_compile_args=["-O3", "-ffp-contract=off"],
        optional=True,
    )


setup(
    name=NAME,
    version=VERSION,
    description="Online error compensation of a flexible 2-DOF spherical parallel wrist",
    long_description="Online error compensation of a flexible 2-DOF spherical parallel wrist: "
    "a solid finite-element sweep becomes a lookup table, and ROS 2 nodes predict the pose error "
    "and correct the motor angles.",
    license="Apache-2.0",
    maintainer="wrist_stiffness maintainers",
    maintainer_email="maintainers@wrist-stiffness.example",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed"]},
    ext_modules=[compiled("mechanism", "_native"), compiled("recording", "_records")],
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        # Puts the command on PATH; colcon.pkg names it.  Nodes lie beside it.
        (f"share/{NAME}/hook", ["resource/hook/path.dsv"]),
        shared("launch/*.launch.py"),
        shared("config/*.*"),
        shared("precomputed/*.npz"),
    ],
    zip_safe=False,
    python_requires=">=3.11",
    # numpy, scipy and PyYAML no newer than in Ubuntu 24.04, the system of ROS 2 Jazzy.
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "PyYAML>=6.0",
        "mcap>=1.1",
        "lz4>=4.0",
        "zstandard>=0.21",
    ],
    extras_require={
        # On a robot rclpy and the messages come from the ROS installation, not from here.
        "ros": [
            "ros-jazzy-rclpy==7.1.6",
            "ros-jazzy-rmw-fastrtps-cpp==8.4.3",
            "ros-jazzy-common-interfaces==5.3.6",
        ],
        "fem": ["netgen-mesher>=6.2.2404", "scikit-fem>=10", "pymetis>=2025.1"],
        "plot": ["matplotlib>=3.8"],
        # Bars of commands that take long; without it they say nothing on the way.
        "progress": ["tqdm>=4.66"],
        # The workbench; Plotly's JavaScript comes with it.
        "web": ["nicegui>=3.0"],
        "docs": ["mkdocs-material>=9.6", "mkdocstrings[python]>=0.29"],
        "verify": ["acrod>=1.2", "rosbags>=0.10", "mcap-ros2-support>=0.5"],
        # colcon finds pytest through this extra and would run no test without it.
        "test": ["pytest>=8", "pytest-xdist>=3.5", "hypothesis>=6.100", "playwright>=1.49"],
        "dev": [
            "ruff>=0.9",
            "mypy>=1.13",
            "types-PyYAML",
            "colcon-common-extensions>=0.3",
            "setuptools>=70.1,<80",
        ],
    },
    entry_points={
        "console_scripts": [
            f"wrist-stiffness = {NAME}.cli.main:main",
            *(f"{node} = {NAME}.ros.start:{node}" for node in NODES),
        ]
    },
)
