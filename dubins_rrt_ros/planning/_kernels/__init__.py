"""The compiled room: Cython in pure Python mode. Numbers and arrays in, numbers and arrays out.

Where a compiler was at hand these modules are extensions that drop the interpreter lock; else the interpreter runs the
same files, some hundred times slower.
"""

from .dubins import COMPILED as COMPILED

#: A length beyond all others, as kernels take and give it.
UNLIMITED = 1e300
