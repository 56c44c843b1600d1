"""Metadata for pip and colcon alike: a [project] table in pyproject.toml would break `colcon build --symlink-install`."""

import os
import sys
from glob import glob
from pathlib import Path

from setuptools import Extension, find_packages, setup

PACKAGE = "dubins_rrt_ros"
# `colcon build --symlink-install` runs a link to this file, in a folder without a README.
SOURCE = Path(__file__).resolve().parent
KERNELS = f"{PACKAGE}/planning/_kernels"


def compiled_kernels():
    """Return the keyword arguments that compile the kernels, where Cython is at hand; without it they run interpreted.

    With DUBINS_RRT_REQUIRE_COMPILED=1 in the environment a build without Cython or a compiler fails.
    Cython's build_ext translates when it builds: cythonize() here would print to standard output, which colcon reads.
    """
    required = os.environ.get("DUBINS_RRT_REQUIRE_COMPILED", "0") not in ("", "0")
    try:
        from Cython.Distutils import build_ext
    except ImportError:
        if required:
            raise
        return {}
    extensions = [
        Extension(path[:-3].replace("/", "."), [path], optional=not required, **compiler_flags())
        for path in sorted(glob(f"{KERNELS}/[a-z]*.py"))
    ]
    return {"ext_modules": extensions, "cmdclass": {"build_ext": build_ext}}


def compiler_flags():
    """Return the flags of this platform's compiler and linker: no contraction, so that results are the same everywhere.

    Debug symbols would make the modules six times as large, and the table of local symbols half as large again.
    """
    if sys.platform == "win32":
        return {"extra_compile_args": ["/O2", "/fp:precise"]}
    return {"extra_compile_args": ["-O3", "-g0", "-ffp-contract=off"],
            "extra_link_args": ["-Wl,-s"] if sys.platform == "linux" else []}


def installed(folder, *patterns):
    """Return a data_files entry that installs files of the source tree into the package's share folder."""
    return f"share/{PACKAGE}/{folder}".rstrip("/"), sorted(path for pattern in patterns for path in glob(pattern))


ROS = ["ros-jazzy-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6"]
PLOTS = ["matplotlib>=3.6", "tqdm>=4.64"]
PLAY = ["aiohttp>=3.8"]
DOCS = ["sphinx>=7.2", "myst-parser>=2.0", "sphinx-rtd-theme>=2.0"]
CLUSTER = ["distributed>=2022.12"]
TEST = ["pytest>=7.4", "pytest-xdist>=3.2", "hypothesis>=6.98", "import-linter>=2.0", "mypy>=1.8", "types-PyYAML>=6.0",
        "ruff>=0.6", "selenium>=4.10", *PLOTS, *PLAY, *CLUSTER]

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Dubins RRT and RRT* for ROS 2: collision-free paths for vehicles that cannot turn on the spot",
    long_description=(SOURCE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    author="dubins_rrt_ros maintainers",
    maintainer="dubins_rrt_ros maintainers",
    license="Apache-2.0",
    python_requires=">=3.11",
    classifiers=[
        "Intended Audience :: Science/Research", "Operating System :: POSIX :: Linux", "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12", "Programming Language :: Python :: 3.13", "Topic :: Scientific/Engineering",
    ],
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"], f"{PACKAGE}.planning._kernels": ["*.pxd"],
                  f"{PACKAGE}.cli.play": ["*.html", "*.css", "*.js"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        installed("", "package.xml"),
        installed("maps", "maps/*"),
        installed("config", "config/*"),
        installed("launch", "launch/*"),
        installed("examples", "examples/*.*"),
        # A wheel ignores setup.cfg's install_scripts, so that `ros2 run` would find nothing after `pip install`.
        (f"lib/{PACKAGE}", ["resource/planner", "resource/dubins_rrt_planner", "resource/dubins_rrt"]),
    ],
    install_requires=["setuptools", "Cython>=3.0", "numpy>=1.26", "scipy>=1.11", "shapely>=2.0.3", "Pillow>=10.2", "PyYAML>=6.0"],
    # Pictures and progress bars; a robot plans without them. What dubins_rrt_ros.evaluation imports besides is the same today.
    extras_require={"ros": ROS, "plots": PLOTS, "play": PLAY, "cluster": CLUSTER, "evaluation": PLOTS, "docs": DOCS,
                    "test": TEST},
    entry_points={
        "console_scripts": [
            f"planner = {PACKAGE}.node.__main__:main",
            f"dubins_rrt_planner = {PACKAGE}.node.__main__:main",  # where others' planners are on the PATH
            f"dubins_rrt = {PACKAGE}.__main__:main",
        ],
    },
    zip_safe=False,
    **compiled_kernels(),
)
