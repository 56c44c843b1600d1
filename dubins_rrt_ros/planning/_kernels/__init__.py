"""The compiled inner loops: Cython in pure Python mode, which takes and returns numbers and arrays alone.

Installed with a compiler, these modules are extensions that release the interpreter lock; without one, the interpreter runs
the same files, some hundred times slower. A `.pxd` beside a module declares the C types of its names.
"""

from pathlib import Path

from .dubins import COMPILED as COMPILED

#: Length that stands for infinity in the arguments and results of the kernels.
UNLIMITED = 1e300


def how_to_compile() -> str:
    """Return what to do where the kernels are interpreted."""
    source = Path(__file__).resolve().parents[3]
    if (source / "setup.py").exists():
        return (f"this is the source folder {source}: start Python in another folder, where it takes the package that is "
                "installed, or compile the kernels here, by `python setup.py build_ext --inplace`")
    return "install a C compiler and Cython, then this package again"
