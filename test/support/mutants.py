"""Mutants: modules with one small change each, and whether tests find it. Each is tried in a process that is forked for it.

Changed are operators, comparisons (to their contrary), numbers, the functions of `TWINS`, and statements that only call or raise
something, which are left out. Not changed are texts, annotations, numbers below `LEAST`, which allow for rounding, and what a
comparison says of equal sides, which numbers with rounding do not tell.
"""

import ast
import copy
import hashlib
import importlib
import os
import resource
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

#: Numbers that are smaller, and not 0, are allowances for rounding.
LEAST = 1e-3
#: Maximum CPU time [s] and memory [bytes] of the tests of a mutant; one that goes on for ever is found.
SECONDS, BYTES = 60, 3 * 2**30
#: Functions that take each other's places.
TWINS = {name: other for pair in (("minimum", "maximum"), ("min", "max"), ("argmin", "argmax"), ("any", "all"), ("sin", "cos"),
                                  ("floor", "ceil")) for name, other in (pair, pair[::-1])}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
             ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.And: ast.Or, ast.Or: ast.And,
             ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
             ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is}
TESTS = Path(__file__).resolve().parents[1]
#: The tests without a search that are to find the mutants of a module.
TESTS_OF = {f"dubins_rrt_ros.{module}": [str(TESTS / f"{test}.py") for test in tests.split()] for module, tests in {
    "checker.bounds": "checker/test_bounds checker/test_spoils",
    "checker.check": "checker/test_claims checker/test_spoils checker/test_check",
    "checker.levels": "checker/test_levels checker/test_spoils", "checker.maps": "checker/test_maps checker/test_claims",
    "planning.audit.cost": "planning/test_audit_cost", "planning.audit.departure": "planning/test_departure",
    "planning.audit.obstacles": "planning/test_audit planning/test_audit_footprint",
    "planning.audit.sweep": "planning/test_audit planning/test_audit_footprint",
    "planning.audit.verdict": "planning/test_audit planning/test_audit_footprint",
    "planning.audit.poses": "planning/test_audit_poses"}.items()}


@dataclass(frozen=True)
class Mutant:
    """A module with one change.

    Attributes:
        module: its name.
        line: of the change.
        change: what is changed into what.
        tree: the syntax of the module.
    """

    module: str
    line: int
    change: str
    tree: ast.Module

    def __str__(self):
        return f"{self.module}:{self.line}: {self.change}"


def mutants_of(module):
    """All mutants of a module, by its name, in the order of its lines."""
    tree = ast.parse(Path(importlib.import_module(module).__file__).read_text("utf-8"))
    places = list(_places(tree))
    for number, (node, field) in enumerate(places):
        for other in _changed(getattr(node, field) if field else node):
            mutated = copy.deepcopy(tree)
            twin, name = list(_places(mutated))[number]
            before = ast.unparse(twin)
            if name:
                setattr(twin, name, other)
            else:
                _replace(mutated, twin, other)
            after = ast.unparse(twin if name else other)
            yield Mutant(module, node.lineno, f"{before!r} -> {after!r}"[:160], ast.fix_missing_locations(mutated))


def sample(module, count):
    """Some mutants of a module, all of them where there are no more; a change elsewhere in the module hardly changes which."""
    def key(mutant):
        return hashlib.sha256(mutant.change.encode()).digest()
    return sorted(mutants_of(module), key=key)[:count]


def _places(tree):
    """Yield (node, field) of all that may be changed: a field, or None for the whole statement."""
    annotations = {child for node in ast.walk(tree) for name in ("annotation", "returns") if getattr(node, name, None)
                   for child in ast.walk(getattr(node, name))}
    for node in ast.walk(tree):
        if node in annotations or not hasattr(node, "lineno"):
            continue
        if isinstance(node, ast.Raise) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            yield node, None
        for field in {"BinOp": ["op"], "AugAssign": ["op"], "BoolOp": ["op"], "Compare": ["ops"], "UnaryOp": ["op"],
                      "Constant": ["value"], "Attribute": ["attr"], "Name": ["id"]}.get(type(node).__name__, ()):
            yield node, field


def _changed(value):
    """Return what may take the place of a value of the syntax."""
    if isinstance(value, ast.Raise | ast.Expr):
        return [ast.Pass()]
    if isinstance(value, list):
        return [[OPERATORS[type(value[0])](), *value[1:]]]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1]
    if isinstance(value, float):
        return [] if 0 < abs(value) < LEAST else [2 * value or 1.0]
    if isinstance(value, ast.USub):
        return [ast.UAdd()]
    if isinstance(value, ast.Invert):
        return [ast.UAdd()]
    if isinstance(value, str) and value in TWINS:
        return [TWINS[value]]
    return [OPERATORS[type(value)]()] if type(value) in OPERATORS else []


def _replace(tree, statement, other):
    for node in ast.walk(tree):
        for block in (getattr(node, name, None) for name in ("body", "orelse", "finalbody")):
            if isinstance(block, list) and statement in block:
                block[block.index(statement)] = ast.copy_location(other, statement)


def is_found(mutant):
    """True if tests fail with a mutant in the place of its module."""
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        try:
            install(mutant)
            options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=no", "-m", "not slow"]
            failed = pytest.main([*options, *TESTS_OF[mutant.module]]) != 0
        except BaseException:
            failed = True
        os._exit(failed)
    return os.waitpid(child, 0)[1] != 0


def install(mutant):
    """Run a mutant in the place of its module, for all modules that took something of it."""
    module = sys.modules[mutant.module]
    before = dict(vars(module))
    exec(compile(mutant.tree, module.__file__, "exec"), vars(module))
    new = {id(old): vars(module)[name] for name, old in before.items()
           if getattr(old, "__module__", None) == mutant.module or name.isupper()}
    for other in list(sys.modules.values()):
        if other is not module and getattr(other, "__name__", "").startswith(("dubins_rrt_ros", "support")):
            for name, value in list(vars(other).items()):
                if id(value) in new and (name in before and before[name] is value):
                    setattr(other, name, new[id(value)])
