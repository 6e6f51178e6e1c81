"""An exercise: the numbers that it draws, the right answer, and the mistakes it expects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from shipnet.exercises.answers import Answer
from shipnet.exercises.students import Student


@dataclass(frozen=True)
class Exercise:
    """One exercise of a lesson."""

    key: str
    answer: Callable[..., Answer]
    draws: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    traps: Mapping[str, Callable[..., object]] = field(default_factory=dict)
    slips: Mapping[str, Callable[..., object]] = field(default_factory=dict)

    def given(self, me: Student) -> dict[str, Any]:
        """Return the numbers of a student.

        Parameters
        ----------
        me : Student
            Who.

        Returns
        -------
        dict
            Name -> value.
        """
        return {
            name: me.pick(f"{self.key} {name}", options) for name, options in self.draws.items()
        }

    def fault(self, answered: object, me: Student) -> str | None:
        """Say what is wrong with an answer."""
        numbers = self.given(me)
        right = self.answer(**numbers)
        fault = right.fault(answered)
        if fault is None:
            return None
        for hint, wrong in self.traps.items():
            # The same kind of answer, with the trap as what is right.
            trapped: Answer = replace(right, value=wrong(**numbers))  # type: ignore[type-var]
            if trapped.fault(answered) is None:
                return hint
        return fault
