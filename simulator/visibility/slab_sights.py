"""Sets of slabs between antennas and facets in 3-D: by tiles, and by rays at slabs' silhouettes.

No ray to a tile crosses a slab if a plane separates the slab from the shaft; all do if the shaft
passes within the slab's outline. Only for other tiles rays are intersected with the slab one by
one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from simulator.geometry.facets import Facets
from simulator.geometry.patches import cut_into_patches
from simulator.geometry.slabs import Slabs
from simulator.visibility.seen import Seen
from simulator.visibility.shaft_culling import GAP, TILE, Obstacle, Sightlines, clear_shafts

Pair = tuple[int, int]
"""Sets of slabs on the leg to a facet and on the leg back."""

MIXED = -1
"""Index of facets whose sets of slabs differ from antenna to antenna."""

LINES_AT_ONCE = 2**24
"""Lines whose sets of slabs are held at one time: 128 MiB. [-]"""


@dataclass
class SlabSights:
    """Sets of slabs through which a scene's facets are seen, over the links of sightlines."""

    slabs: Slabs
    sightlines: Sightlines
    chosen: Int[np.ndarray, " chosen"]  # facets to be classified
    convex: Sequence[int]  # sets of faces of each object that never hide its own facets
    pairs: list[Pair] = field(default_factory=list, init=False)  # that occur

    def __post_init__(self) -> None:
        """Group the facets by the sets of slabs through which they are seen."""
        self.pairs.append((0, 0))
        count = self.facets.count
        self._index = np.zeros(count, dtype=np.int16)
        if not len(self.slabs) or self.chosen.size == 0:
            return
        tiles = cut_into_patches(self.facets.part(self.chosen), np.arange(len(self.chosen)), TILE)
        owner = self.chosen[tiles.order]
        sets = [
            self._tile_sets(ends, tiles.centres, tiles.radii, owner, tiles.first)
            for ends in self._ends
        ]
        mixed = np.any([one == MIXED for one in sets], axis=0)
        both = np.stack([sets[0], sets[-1]], axis=-1)
        known, index = np.unique(both[~mixed], axis=0, return_inverse=True)
        numbers = [self._number((int(out), int(back))) for out, back in known]
        per_tile = np.full(tiles.count, MIXED, dtype=np.int16)
        per_tile[~mixed] = np.array(numbers, dtype=np.int16)[index.ravel()]
        self._index[owner] = np.repeat(per_tile, np.diff(tiles.first))
        for _, out, back in self._by_rays(self.chosen[self._index[self.chosen] == MIXED]):
            for pair in np.unique(np.stack([out.ravel(), back.ravel()], axis=-1), axis=0).tolist():
                self._number((pair[0], pair[1]))

    @property
    def facets(self) -> Facets:
        """All facets of the scene."""
        return self.sightlines.facets

    def may_be(self, pair: Pair) -> Bool[np.ndarray, " facets"]:
        """Return which facets are seen through a pair of sets, from at least one antenna."""
        chosen = np.zeros(self.facets.count, dtype=bool)
        index = self._index[self.chosen]
        chosen[self.chosen] = (index == self.pairs.index(pair)) | (index == MIXED)
        return chosen

    def over(self, pair: Pair, some: Int[np.ndarray, " some"]) -> Seen:
        """Return the visibility of facets through one pair of sets of slabs only."""
        seen = self.sightlines(some)
        index = self._index[some]
        alike, mixed = index == self.pairs.index(pair), index == MIXED
        if not mixed.any():
            kept = alike[seen.sometimes]
            return Seen(
                always=seen.always & alike,
                sometimes=seen.sometimes[kept],
                table=seen.table[kept],
            )
        table = np.zeros((len(some), len(self.sightlines.receivers)), dtype=bool)
        table[seen.sometimes] = seen.table
        table[seen.always] = True
        table[~alike & ~mixed] = False
        places = np.flatnonzero(mixed)
        row = 0
        for here, out, back in self._by_rays(some[mixed]):
            rows = places[row : row + len(here)]
            table[rows] &= ((out == pair[0]) & (back == pair[1])).T
            row += len(here)
        always = seen.always & alike
        sometimes = np.flatnonzero(table.any(axis=1) & ~always)
        return Seen(always=always, sometimes=sometimes, table=table[sometimes])

    def _number(self, pair: Pair) -> int:
        if pair not in self.pairs:
            self.pairs.append(pair)
        return self.pairs.index(pair)

    @cached_property
    def _ends(self) -> list[Float[np.ndarray, "ends 3"]]:
        senders, receivers = self.sightlines.senders, self.sightlines.receivers
        return [receivers] if senders is receivers else [senders, receivers]

    def _by_rays(
        self, some: Int[np.ndarray, " some"]
    ) -> "list[tuple[np.ndarray, np.ndarray, np.ndarray]]":
        """Return facets, and their sets over all links, by rays from all antennas to them."""
        count = len(self.sightlines.receivers)
        found = []
        for here in np.array_split(some, 1 + some.size * count // LINES_AT_ONCE):
            if here.size == 0:
                continue
            places = self.facets.places[here]
            off = self.sightlines.rays.clearance
            sets = [
                self.slabs.crossed_between(ends, places, off=off).astype(np.int64)
                for ends in self._ends
            ]
            sets = [np.broadcast_to(one, (count, here.size)) for one in sets]
            found.append((here, sets[0], sets[-1]))
        return found

    def _tile_sets(
        self,
        ends: Float[np.ndarray, "ends 3"],
        centres: Float[np.ndarray, "tiles 3"],
        radii: Float[np.ndarray, " tiles"],
        owner: Int[np.ndarray, " facets"],
        first: Int[np.ndarray, " tiles_and_one"],
    ) -> Int[np.ndarray, " tiles"]:
        """Return the set of slabs through which each tile is seen; or :data:`MIXED`."""
        material = self.facets.material
        of_tile = np.zeros(len(centres), dtype=np.int64)
        if material is not None:
            of_tile = material[owner[first[:-1]]].astype(np.int64)
            same = np.maximum.reduceat(material[owner], first[:-1]) == np.minimum.reduceat(
                material[owner], first[:-1]
            )
            of_tile[~same] = -1
        sets = np.zeros(len(centres), dtype=np.int64)
        box = np.array(np.meshgrid(*zip(ends.min(axis=0), ends.max(axis=0), strict=True)))
        corners = np.unique(box.reshape(3, -1).T, axis=0)
        cube = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        off = self.sightlines.rays.clearance
        for face in range(len(self.slabs)):
            convex = np.array([bool(one >> face & 1) for one in self.convex] + [False])
            own = convex[of_tile]  # the last: tiles of several objects
            left = np.flatnonzero((sets != MIXED) & ~own)
            if left.size == 0:
                continue
            left = left[~clear_shafts(ends, centres[left], radii[left], [self._obstacle(face)])]
            if left.size == 0:
                continue
            around = centres[left, None] + radii[left, None, None] * cube  # [tiles, 8, 3]
            bit = self.slabs.crossed_between(corners, around.reshape(-1, 3), off=off) >> face & 1
            whole = bit.reshape(len(corners), left.size, 8).all(axis=(0, 2))
            sets[left[whole]] |= 1 << face
            sets[left[~whole]] = MIXED
        return sets

    def _obstacle(self, face: int) -> Obstacle:
        corners = self.slabs.faces.corners[face]
        along = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(along, axis=-1)
        edges = along[lengths > 0] / lengths[lengths > 0, None]
        inward = self.slabs.faces.inward[face][lengths > 0]
        axes = np.concatenate([self.slabs.faces.normals[face][None], inward])
        return Obstacle(owner=-1, corners=corners, axes=axes, edges=edges, margin=GAP)
