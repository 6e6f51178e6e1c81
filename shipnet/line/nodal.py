"""Transfer impedances of any network, by a dense solution of the nodal equations.

It needs no tree, so it serves the ring; and it is the second route to what a tree's sweep finds.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.line.tree import rooted, slices
from shipnet.line.waves import Complexes, Lines, admittances, check_frequencies

if TYPE_CHECKING:
    from shipnet.line.network import Network

__all__ = ["dense_transfer"]

#: Elements of the matrices that are solved at a time.
_BLOCK = 1 << 20


def dense_transfer(network: Network, root: str, s: npt.ArrayLike) -> Complexes:
    """Return the transfer impedances between one node and every node of any network.

    Parameters
    ----------
    network : Network
        The network, a tree or with a ring.
    root : str
        The one node.
    s : array_like of complex, shape (n_s,)
        As for `transfer`.

    Returns
    -------
    ndarray of complex, shape (n_nodes, n_s) or (n_trees, n_nodes, n_s)
        As `Network.transfer` [ohm].

    Raises
    ------
    ArgumentError
        As `Network.transfer`.

    Examples
    --------
    >>> from shipnet.line import Cable, Network
    >>> net = Network()
    >>> net.line("near", "far", 40, Cable.lossless(120, 5e-9))
    >>> net.terminator("far", 120)
    >>> abs(dense_transfer(net, "near", [1e6j])).round(9).tolist()
    [[120.0], [120.0]]
    """
    s = check_frequencies(s)
    rooted(network, root)
    lines = Lines(network, s)
    shunts = network.shunts()
    nodes = len(network.nodes)
    ends = [(network.index(a), network.index(b)) for a, b, *_ in network.branches]
    unit = np.zeros((nodes, 1))
    unit[network.index(root)] = 1

    trees, every = network.trees or 1, list(range(len(lines.cable)))
    z = np.empty((trees, nodes, s.size), dtype=complex)
    blocks = slices(trees, 1), slices(s.size, _BLOCK // nodes**2)
    for some, bins in product(*blocks):
        e2, c, sinh, y0, _ = lines.waves(every, some, bins)
        own, mutual = (y0 * c / sinh)[:, 0], (y0 * e2 / sinh)[:, 0]
        matrix = np.zeros((s[bins].size, nodes, nodes), dtype=complex)
        matrix[:, range(nodes), range(nodes)] = admittances(shunts, some, s[bins])[:, 0].T
        for (a, b), kind in zip(ends, lines.kind, strict=True):
            for i, j in ((a, b), (b, a)):
                matrix[:, i, i] += own[kind]
                matrix[:, i, j] -= mutual[kind]
        z[some.start, :, bins] = np.linalg.solve(matrix, unit)[..., 0].T
    return z if network.trees else z[0]
