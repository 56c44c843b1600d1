"""The compiled inner loops: Cython in pure Python mode, which takes and returns numbers and arrays alone.

Installed with a compiler, these modules are extensions that release the interpreter lock; without one, the interpreter runs
the same files, some hundred times slower. A `.pxd` beside a module declares the C types of its names.
"""

from .dubins import COMPILED as COMPILED

#: Length that stands for infinity in the arguments and results of the kernels.
UNLIMITED = 1e300
