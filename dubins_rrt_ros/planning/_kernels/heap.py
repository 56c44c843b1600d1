# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""A binary heap of numbered items with the least key on top."""

import cython
import numpy as np

from .arrays import resized


@cython.cclass
class Heap:
    """A heap with room for `capacity` items, of which `count` are in it."""

    def __init__(self, capacity):
        self.items, self.keys = np.empty(capacity, np.int32), np.empty(capacity)
        self.count = 0

    def reserve(self, more: cython.int):
        """Make room for `more` items."""
        if self.count + more > self.keys.shape[0]:
            capacity = self.count + max(more, self.count)
            self.items, self.keys = resized(self.items, capacity), resized(self.keys, capacity)

    def least_key(self):
        """Return the key of the item on top; the heap must not be empty."""
        return self.keys[0]

    def push(self, item, key):
        """Add an item; there must be room."""
        i: cython.int = self.count
        self.count += 1
        while i > 0 and self.keys[(i - 1) // 2] > key:
            self.items[i], self.keys[i] = self.items[(i - 1) // 2], self.keys[(i - 1) // 2]
            i = (i - 1) // 2
        self.items[i], self.keys[i] = item, key

    def pop(self):
        """Take the item with the least key; the heap must not be empty."""
        top: cython.int = self.items[0]
        self.count -= 1
        last: cython.int = self.items[self.count]
        key: cython.double = self.keys[self.count]
        i: cython.int = 0
        child: cython.int = 1
        while child < self.count:
            if child + 1 < self.count and self.keys[child + 1] < self.keys[child]:
                child += 1
            if self.keys[child] >= key:
                break
            self.items[i], self.keys[i] = self.items[child], self.keys[child]
            i, child = child, 2 * child + 1
        self.items[i], self.keys[i] = last, key
        return top
