"""A world: what depends on map, vehicle and the use of unknown space alone, computed once for many requests."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from .audit.obstacles import Obstacles, obstacles_of
from .collision.clearance import ClearanceField
from .collision.own_test import OwnTest
from .maps.model import GridMap, Map, PolygonMap
from .problem import Problem
from .settings import Settings
from .text import quoted
from .vehicle import Vehicle


class World:
    """A map, prepared for a vehicle; `prepare` makes one, and `Problem` takes it in place of the two.

    It is a value: it never changes, and several threads may use it. What was computed is dropped when it is pickled, and made
    again when it is asked for.

    Attributes:
        map: free and occupied space.
        vehicle: the vehicle that it is prepared for.
        allow_unknown: True if the vehicle may drive through unknown space.
    """

    def __init__(self, world_map: Map, vehicle: Vehicle, allow_unknown: bool = False):
        self.map, self.vehicle, self.allow_unknown = world_map, vehicle, allow_unknown

    @cached_property
    def field(self) -> ClearanceField:
        """The distances to the nearest obstacle, with the components and the squares that are free for the vehicle."""
        return ClearanceField(self.map, self.allow_unknown)

    @cached_property
    def obstacles(self) -> Obstacles:
        """The true shapes of the obstacles, for the audit."""
        return obstacles_of(self.map, self.allow_unknown)

    def for_vehicle(self, vehicle: Vehicle) -> "World":
        """Prepare the same map for another vehicle: the clearance is shared, and this world stays as it is."""
        return prepare(self.map, vehicle, self.allow_unknown, self)

    def updated(self, new_map: Map) -> "World":
        """Prepare another map, which differs in places: what is the same as here is reused, and this world stays as it is.

        Returns:
            Bit for bit the world that `prepare` makes of the other map.
        """
        return prepare(new_map, self.vehicle, self.allow_unknown, self)

    def with_test_of(self, problem: Problem) -> "World":
        """Return this world for a problem with an `is_free`, which its collision checkers ask too; else this world itself."""
        known = self.field.own_test
        if problem.is_free is None or (known and known.is_free is problem.is_free):
            return self
        other = World(self.map, self.vehicle, self.allow_unknown)
        other.field = self.field.with_own_test(OwnTest(problem.is_free, problem.fine_spacing))
        other.obstacles = self.obstacles
        return other

    def with_costs(self, has_costs: bool) -> "World":
        """Return the world of `GridMap.with_costs`: this one where that makes no difference, else another, which is kept."""
        return self if self.map.with_costs(has_costs) is self.map else self._with_other_costs

    @cached_property
    def _with_other_costs(self) -> "World":
        other = self.map.with_costs(self.map.costs is None)
        return prepare(other, self.vehicle, self.allow_unknown)

    def __reduce__(self) -> tuple[Any, ...]:
        return World, (self.map, self.vehicle, self.allow_unknown)

    def __repr__(self) -> str:
        return f"World(map={self.map.name!r}, vehicle={self.vehicle}, allow_unknown={self.allow_unknown})"


def world_of(problem: Problem) -> World:
    """Return the world of a problem, without its `is_free`; one is prepared where it has none."""
    world = problem.world
    return world if isinstance(world, World) else prepare(problem.map, problem.vehicle, problem.allow_unknown)


def prepare(map: Map, vehicle: Vehicle, allow_unknown: bool = False,  # noqa: A002 - a public name
            previous: World | None = None) -> World:
    """Compute what depends on map and vehicle alone, so that requests need not wait for it.

    Args:
        map: free and occupied space.
        vehicle: what drives there.
        allow_unknown: True if it may drive through unknown space.
        previous: a world whose parts are reused where they are the same, of this map or of one that differs in places. It
            makes no difference to the result, and is not kept.

    Raises:
        TypeError: `map` is no map, or `vehicle` no Vehicle.
    """
    if not isinstance(map, GridMap | PolygonMap):
        raise TypeError(f"the map is {quoted(map)}; give a GridMap or a PolygonMap; load_map reads files")
    if not isinstance(vehicle, Vehicle):
        raise TypeError(f"the vehicle is {quoted(vehicle)}; give a Vehicle")
    world = World(map, vehicle, allow_unknown)
    if previous is not None and previous.allow_unknown == allow_unknown:
        _reuse(world, previous)
    world.field.components(vehicle.required_clearance)
    world.field.free_squares(vehicle.required_clearance)
    if vehicle.footprint:
        world.field.room(vehicle)  # the first one finds the corners of the obstacles, which are kept
    world.obstacles  # noqa: B018 - computed now
    return world


def problem_with_costs(problem: Problem, settings: Settings) -> Problem:
    """Return a problem as the settings take it: with cells between the thresholds free, at a cost, or unknown.

    Its world, where it has one, is prepared for that.
    """
    has_costs = settings.weight_of_cells > 0
    if problem.map.with_costs(has_costs) is problem.map:
        return problem
    if not isinstance(problem.world, World):
        return replace(problem, map=problem.map.with_costs(has_costs), world=None)
    world = problem.world.with_costs(has_costs)
    return replace(problem, map=world.map, world=world)


def _reuse(world: World, previous: World) -> None:
    """Take over from `previous` what `world` has in common with it."""
    if world.map is previous.map or _are_equal(world.map, previous.map):
        takes_as_much_room = world.vehicle.required_clearance == previous.vehicle.required_clearance
        world.field = previous.field if takes_as_much_room else previous.field.shared()
        world.obstacles = previous.obstacles
    else:
        world.field = ClearanceField(world.map, world.allow_unknown, previous.field)


def _are_equal(one: Map, other: Map) -> bool:
    """Return True for two grids that are the same but for their names."""
    return (isinstance(one, GridMap) and isinstance(other, GridMap) and one.thresholds == other.thresholds
            and (one.resolution, one.origin) == (other.resolution, other.origin) and np.array_equal(one.data, other.data))
