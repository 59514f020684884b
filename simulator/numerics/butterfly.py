r"""Butterfly sum: links between the facets of two faces, block by block, at low rank.

Between a block of facets around :math:`w_0` and one around :math:`q_0` the distance is decomposed,

.. math:: r(w, q) = r(w, q_0) + \bigl(r(w_0, q) - r(w_0, q_0)\bigr) + \rho(w, q)

The first two terms depend on one end each. The mixed term :math:`\rho` grows only with the product
of both sizes over the distance, so that :math:`e^{-jk\rho}`, the spreading and the directions are
interpolated from a few Chebyshev points of either block's bounding box. Facets are summed into the
points of their block (the transposed interpolation), points into points, and points interpolated to
facets: in place of n · m links between facets there are a few for each facet. Roughness is exact:
the terms that depend on one end are evaluated at the facets' true positions.

This is one level of a butterfly scheme (E. Candès, L. Demanet, L. Ying, "A fast butterfly
algorithm for the computation of Fourier integral operators", Multiscale Model. Simul. 7, 2009,
doi:10.1137/080734339). Links between blocks that are close, or see each other only in part, are
summed one by one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Complex64, Float, Float32, Int
from scipy.constants import speed_of_light
from scipy.special import jv

from simulator.numerics.nufft_sum import barycentric_basis, chebyshev_nodes

LINK_ACCURACY = 1e-3
"""Bound of the interpolation error relative to each facet's contribution; in the sum, errors cancel
to a hundredth of it. The error of physical optics itself is some 1e-2. [-]"""

PHASE_OF_BLOCKS = 6.0
"""Mixed phase of two blocks that face each other, from which their size is chosen. [rad]"""

NEAREST = 3.0
"""Distance of two blocks, over half the size of the larger, below which links are summed singly.
[-]"""

AMPLITUDE_POINTS = 2
"""Interpolation points for spreading and directions beyond those for the phase; at a distance of
:data:`NEAREST` and more their error is below :data:`LINK_ACCURACY`. [-]"""

FLAT = 0.05
"""Ratio of a box's sides up to which spreading and directions are taken as constant across it: they
vary by the half side over the distance, a 60th at :data:`NEAREST`. [-]"""

LARGEST_RANK = 0.7
"""Ratio of a block's points to its facets beyond which interpolation saves no time. [-]"""


@dataclass(frozen=True, kw_only=True)
class Block:
    """Neighbouring facets, with the interpolation points that represent them."""

    members: Int[np.ndarray, " facets"]
    centre: Float[np.ndarray, " 2"]  # [m]
    points: Float[np.ndarray, "points 2"]  # [m]
    weights: Float32[np.ndarray, "facets points"]  # of the interpolation


@dataclass(frozen=True, kw_only=True)
class BlockPair:
    """Two blocks, each facet of which sees the whole other block or nothing of it."""

    sender: int  # index of the wall's block
    receiver: int  # index of the target's block
    sends: Bool[np.ndarray, " wall"]  # which facets of the block see the other
    hears: Bool[np.ndarray, " target"]
    sent_lengths: Float[np.ndarray, " wall"]  # to the other's centre [m]
    heard_lengths: Float[np.ndarray, " target"]  # from the other's centre, less both's [m]
    mixed: Float[np.ndarray, "points others"]  # [m]
    spreading: Float32[np.ndarray, "points others"]  # [m^-1/2]
    directions: Float32[np.ndarray, "2 points others"]


Variation = Callable[[Float[np.ndarray, "n 2"]], int]
"""Points along an axis that something between two blocks needs beyond those of free space, from
unit vectors that span the directions of their links. [-]"""

Inserted = Callable[[BlockPair], Complex64[np.ndarray, "from to"]]
"""Factor of something between the points of two blocks. [-]"""


@dataclass(frozen=True, kw_only=True)
class LinkPlan:
    """Division of the links between two faces into block pairs, up to a highest frequency."""

    senders: tuple[Block, ...]
    receivers: tuple[Block, ...]
    pairs: tuple[BlockPair, ...]
    left: Bool[np.ndarray, "wall target"]  # links to be summed one by one
    by_sender: dict[int, list[BlockPair]] = field(default_factory=dict)
    by_receiver: dict[int, list[BlockPair]] = field(default_factory=dict)


def plan_links(
    wall: Float[np.ndarray, "wall 2"],
    target: Float[np.ndarray, "target 2"],
    seen: Bool[np.ndarray, "wall target"],
    highest: float,
    *,
    variation: "Variation | None" = None,
) -> LinkPlan:
    """Divide two faces into blocks, and select block pairs of low rank.

    Parameters
    ----------
    wall, target
        Centres of the radiating and of the receiving facets. [m]
    seen
        Which of them see each other.
    highest
        Highest frequency. [Hz]
    variation
        Points that what is between the faces needs, from the directions of links; None: nothing.
    """
    wavenumber = 2 * np.pi * highest / speed_of_light
    apart = float(np.linalg.norm(wall.mean(axis=0) - target.mean(axis=0)))
    size = float(np.sqrt(4 * PHASE_OF_BLOCKS * apart / wavenumber))
    boxes = tuple(
        [_Box.around(points, part) for part in _bisected(points, size)] for points in (wall, target)
    )
    chosen: list[tuple[int, int, np.ndarray, np.ndarray]] = []
    left = seen.copy()
    for i, one in enumerate(boxes[0]):
        for j, other in enumerate(boxes[1]):
            here = np.ix_(one.members, other.members)
            block = seen[here]
            sends, hears = block.any(axis=1), block.any(axis=0)
            whole = bool(block[np.ix_(sends, hears)].all())
            if sends.any() and whole and _far(one, other):
                chosen.append((i, j, sends, hears))
    counts = [
        _point_counts(boxes[side], boxes[1 - side], chosen, side, wavenumber, variation)
        for side in (0, 1)
    ]
    blocks = [
        tuple(box.block(count) for box, count in zip(boxes[side], counts[side], strict=True))
        for side in (0, 1)
    ]
    pairs = []
    for i, j, sends, hears in chosen:
        sender, receiver = blocks[0][i], blocks[1][j]
        if _saves(sender) and _saves(receiver):
            pairs.append(_pair(i, j, sender, receiver, wall, target, sends, hears))
            left[np.ix_(sender.members, receiver.members)] = False
    plan = LinkPlan(senders=blocks[0], receivers=blocks[1], pairs=tuple(pairs), left=left)
    for pair in pairs:
        plan.by_sender.setdefault(pair.sender, []).append(pair)
        plan.by_receiver.setdefault(pair.receiver, []).append(pair)
    return plan


def sum_planned(
    plan: LinkPlan,
    sources: Complex64[np.ndarray, "3 ports wall"],
    targets: int,
    frequency: float,
    inserted: "Inserted | None" = None,
) -> Complex64[np.ndarray, "3 ports target"]:
    r"""Sum the fields that blocks radiate to blocks at one frequency.

    Parameters
    ----------
    plan
        After :func:`plan_links`.
    sources
        A monopole :math:`s` and a dipole :math:`\mathbf d` at each radiating facet, with the field
        :math:`(s + \mathbf d \cdot \hat u)\, e^{-jkr} / \sqrt r` in a direction :math:`\hat u`.
    targets
        Number of receiving facets.
    frequency
        [Hz].
    inserted
        Factor of what is between two blocks' points at this frequency; None: free space.

    Returns
    -------
    The field, and the field times :math:`-\hat u`, the direction of arrival.
    """
    ports = sources.shape[1]
    received = np.zeros((3, ports, targets), np.complex64)
    arriving: dict[tuple[int, int], np.ndarray] = {}
    per_metre = frequency / speed_of_light
    for index, pairs in plan.by_sender.items():
        block = plan.senders[index]
        points = len(block.points)
        carriers = np.stack([pair.sends * phasor(-per_metre * pair.sent_lengths) for pair in pairs])
        spread = block.weights[:, None, :] * carriers.T[:, :, None]
        sent = sources[:, :, block.members].reshape(3 * ports, -1) @ spread.reshape(
            len(block.members), -1
        )
        sent = np.ascontiguousarray(
            sent.reshape(3, ports, len(pairs), points).transpose(2, 1, 0, 3)
        ).reshape(len(pairs), ports, 3 * points)
        for place, pair in enumerate(pairs):
            arriving[pair.sender, pair.receiver] = sent[place] @ _point_links(
                pair, per_metre, inserted
            )
    for index, pairs in plan.by_receiver.items():
        block = plan.receivers[index]
        points = len(block.points)
        carriers = np.stack(
            [pair.hears * phasor(-per_metre * pair.heard_lengths) for pair in pairs]
        )
        spread = carriers[:, None, :] * block.weights.T
        heard = np.stack([arriving[pair.sender, pair.receiver] for pair in pairs])
        heard = np.ascontiguousarray(
            heard.reshape(len(pairs), ports, 3, points).transpose(2, 1, 0, 3)
        ).reshape(3 * ports, -1)
        total = heard @ spread.reshape(-1, len(block.members))
        received[:, :, block.members] = total.reshape(3, ports, -1)
    return received


def _point_links(
    pair: BlockPair, per_metre: float, inserted: "Inserted | None"
) -> Complex64[np.ndarray, "from to"]:
    """Return the matrix of two blocks' points: monopole and dipole to field and directions."""
    link = pair.spreading * phasor(-per_metre * pair.mixed)
    if inserted is not None:
        link = link * inserted(pair)
    ones = np.ones_like(link.real)[None]
    sent = np.concatenate([ones, pair.directions])
    heard = np.concatenate([ones, -pair.directions])
    links = np.einsum("cnm,dnm,nm->cndm", sent, heard, link)
    return np.asarray(links.reshape(3 * link.shape[0], 3 * link.shape[1]), dtype=np.complex64)


def phasor(turns: Float[np.ndarray, "*n"]) -> Complex64[np.ndarray, "*n"]:
    """Return exp(j2π·turns); whole turns (thousands) are removed first, for precision."""
    angle = np.asarray((turns - np.rint(turns)) * (2 * np.pi), dtype=np.float32)
    phasor = np.empty(angle.shape, np.complex64)
    np.cos(angle, out=phasor.real)
    np.sin(angle, out=phasor.imag)
    return phasor


@dataclass(frozen=True, kw_only=True)
class _Box:
    """The bounding box of some facets, along their principal axes."""

    members: Int[np.ndarray, " facets"]
    centre: Float[np.ndarray, " 2"]
    axes: Float[np.ndarray, "2 2"]
    half: Float[np.ndarray, " 2"]
    local: Float[np.ndarray, "facets 2"]

    @classmethod
    def around(
        cls, points: Float[np.ndarray, "n 2"], members: Int[np.ndarray, " facets"]
    ) -> "_Box":
        inside = points[members]
        mean = inside.mean(axis=0)
        axes = np.linalg.svd(np.cov((inside - mean).T, bias=True))[2]
        local = (inside - mean) @ axes.T
        low, high = local.min(axis=0), local.max(axis=0)
        middle = (low + high) / 2
        return cls(
            members=members,
            centre=mean + middle @ axes,
            axes=axes,
            half=(high - low) / 2,
            local=local - middle,
        )

    @property
    def corners(self) -> Float[np.ndarray, "corners 2"]:
        """Corners, middles of the sides and centre."""
        signs = np.array([(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
        corners: np.ndarray = self.centre + (signs * self.half) @ self.axes
        return corners

    def block(self, counts: tuple[int, int]) -> Block:
        grids, bases = [], []
        for axis, count in enumerate(counts):
            reach = max(float(self.half[axis]), np.finfo(np.float64).tiny)
            grid = chebyshev_nodes(-reach, reach, count)
            grids.append(grid)
            bases.append(barycentric_basis(grid, self.local[:, axis]).T)
        places = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 2)
        weights = np.einsum("fa,fb->fab", *bases).reshape(len(self.members), -1)
        return Block(
            members=self.members,
            centre=self.centre,
            points=self.centre + places @ self.axes,
            weights=weights.astype(np.float32),
        )


def _bisected(points: Float[np.ndarray, "n 2"], size: float) -> list[Int[np.ndarray, " part"]]:
    """Bisect a set of points across its longer side until no part is longer than a size."""
    done: list[np.ndarray] = []
    parts = [np.arange(len(points))]
    while parts:
        part = parts.pop()
        extent = np.ptp(points[part], axis=0)
        if extent.max() <= size or len(part) < 2:
            done.append(part)
            continue
        order = part[np.argsort(points[part, int(np.argmax(extent))], kind="stable")]
        parts += [np.sort(order[len(order) // 2 :]), np.sort(order[: len(order) // 2])]
    return done


def _far(one: _Box, other: _Box) -> bool:
    radii = float(np.hypot(*one.half)), float(np.hypot(*other.half))
    apart = float(np.linalg.norm(one.centre - other.centre))
    return apart - sum(radii) > NEAREST * max(radii)


def _saves(block: Block) -> bool:
    return len(block.points) <= LARGEST_RANK * len(block.members)


def _point_counts(
    boxes: Sequence[_Box],
    others: Sequence[_Box],
    chosen: Sequence[tuple[int, int, np.ndarray, np.ndarray]],
    side: int,
    wavenumber: float,
    variation: "Variation | None",
) -> list[tuple[int, int]]:
    """Return the points along both axes of each box that suffice for all its linked boxes."""
    counts = []
    for index, box in enumerate(boxes):
        phases, added = np.zeros(2), 0
        for link in chosen:
            one, far = (link[0], link[1]) if side == 0 else (link[1], link[0])
            if one != index:
                continue
            other = others[far]
            towards = other.corners[:, None] - box.corners
            towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
            middle = other.centre - box.corners
            middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
            turned = np.abs((towards - middle) @ box.axes.T).max(axis=(0, 1))
            phases = np.maximum(phases, wavenumber * box.half * turned)
            if variation is not None:
                ways = towards.reshape(-1, 2)
                added = max(added, variation(ways))
        # Across a nearly flat box spreading and directions are constant.
        more = (AMPLITUDE_POINTS + added) * (box.half > FLAT * box.half.max())
        first, second = (
            _nodes_for(float(phase)) + int(extra) for phase, extra in zip(phases, more, strict=True)
        )
        counts.append((first, second))
    return counts


def _nodes_for(half_phase: float) -> int:
    r"""Count the Chebyshev nodes that interpolate a phase within ± some angle. [-].

    As :func:`simulator.multibounce.frequency_interpolation.nodes_for_chain`, to
    :data:`LINK_ACCURACY`.
    """
    orders = np.arange(1, 40 + int(2 * half_phase))
    left_out = 4 * np.cumsum(np.abs(jv(orders, half_phase))[::-1])[::-1]
    return int(orders[np.argmax(left_out <= LINK_ACCURACY)])


def _pair(
    i: int,
    j: int,
    sender: Block,
    receiver: Block,
    wall: Float[np.ndarray, "wall 2"],
    target: Float[np.ndarray, "target 2"],
    sends: Bool[np.ndarray, " sending"],
    hears: Bool[np.ndarray, " hearing"],
) -> BlockPair:
    between = receiver.points - sender.points[:, None]
    distance = np.linalg.norm(between, axis=-1)
    centres = float(np.linalg.norm(receiver.centre - sender.centre))
    to_centre = np.linalg.norm(receiver.centre - sender.points, axis=-1)
    from_centre = np.linalg.norm(receiver.points - sender.centre, axis=-1)
    return BlockPair(
        sender=i,
        receiver=j,
        sends=sends,
        hears=hears,
        sent_lengths=np.linalg.norm(receiver.centre - wall[sender.members], axis=-1),
        heard_lengths=np.linalg.norm(target[receiver.members] - sender.centre, axis=-1) - centres,
        mixed=distance - to_centre[:, None] - from_centre + centres,
        spreading=(1 / np.sqrt(distance)).astype(np.float32),
        directions=np.moveaxis(between / distance[..., None], -1, 0).astype(np.float32),
    )
