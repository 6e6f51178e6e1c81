"""All ramps of a rule base at once, and which of them each rule needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf

import numpy as np
import numpy.typing as npt

from shipnet.fuzzy.terms import Variable

__all__ = ["Ramps"]

Floats = npt.NDArray[np.float64]


class Ramps:
    r"""What `Term.membership` says of many terms, as rows of one array.

    A trapezoid is the smaller of two ramps, and a rule the smallest of its terms, so that a rule is
    the smallest of ramps: one that rises with x, or with -x.

    .. math:: w = \min_k \min \left( \frac{s_k x_k - a_k}{b_k - a_k}, 1 \right)

    Parameters
    ----------
    variables : sequence of Variable
        The variables, in the order of the rows that `strengths` is given.
    antecedents : iterable of sequence of (str, str)
        Of each rule the pairs of variable and term, which exist.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> ramps = Ramps(base.variables, [rule.antecedent for rule in base.rules])
    >>> ramps.strengths(np.array([[120], [2.83], [1], [50], [40], [9]], float))[3]
    array([0.5])
    """

    def __init__(
        self,
        variables: Sequence[Variable],
        antecedents: Iterable[Sequence[tuple[str, str]]],
    ) -> None:
        places = {variable.name: place for place, variable in enumerate(variables)}
        self._low = np.array([[variable.low] for variable in variables])
        self._high = np.array([[variable.high] for variable in variables])
        ramps: dict[tuple[int, float, float, float], int] = {}
        rules: list[list[int]] = []
        for antecedent in antecedents:
            rules.append([])
            for name, term in antecedent:
                a, b, c, d = variables[places[name]].term(term).corners
                rising = [(places[name], 1.0, a, b)] if a > -inf else []
                falling = [(places[name], -1.0, -d, -c)] if d < inf else []
                for ramp in rising + falling:
                    rules[-1].append(ramps.setdefault(ramp, len(ramps)))
        variable, sign, foot, shoulder = (np.array(row) for row in zip(*ramps, strict=True))
        self._variable = variable
        # The longest rules first: those that have a k-th ramp are then the first so many.
        self._order = np.array(sorted(range(len(rules)), key=lambda k: -len(rules[k])))
        longest = len(rules[self._order[0]])
        self._needed = [
            np.array([rules[k][place] for k in self._order if len(rules[k]) > place])
            for place in range(longest)
        ]
        self._sign, self._foot, self._shoulder = (x[:, np.newaxis] for x in (sign, foot, shoulder))
        self._steps = np.flatnonzero(foot == shoulder)
        self._width = np.where(foot == shoulder, 1.0, shoulder - foot)[:, np.newaxis]

    def strengths(self, x: Floats) -> Floats:
        """Return how far each rule holds for each sample.

        Parameters
        ----------
        x : ndarray of float, shape (n_variables, n_samples)
            Values; clipped to the universe of their variable. NaN is a member of nothing.

        Returns
        -------
        ndarray of float, shape (n_rules, n_samples)
            0..1.
        """
        within = np.minimum(np.maximum(x, self._low), self._high)
        signed = within[self._variable]
        signed *= self._sign
        # fmax drops a NaN, which so becomes 0. Nothing overflows, however narrow the ramp.
        part = np.fmax(signed, self._foot)
        np.minimum(part, self._shoulder, out=part)
        part -= self._foot
        part /= self._width
        for step in self._steps:
            part[step] = signed[step] >= self._foot[step]
        least = part[self._needed[0]]
        for needed in self._needed[1:]:
            some = least[: needed.size]
            np.minimum(some, part[needed], out=some)
        strength = np.empty(least.shape)
        strength[self._order] = least
        return strength
