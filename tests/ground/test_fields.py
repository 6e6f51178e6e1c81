"""Declared numbers: their checks, error texts and documentation."""

import ast
from pathlib import Path

import numpy as np
import pytest

from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import (
    check_fields,
    check_quantity,
    check_scalar,
    check_whole,
    choice,
    declared,
    number,
    record,
    switch,
    text,
    whole,
)


@record
class Line:
    """A line of slaves.

    Examples
    --------
    >>> Line(100.0).slaves
    31
    """

    length: float = number(0, 500, "m", "Length of the cable")
    slaves: int = whole(1, 62, "", "Number of slaves", default=31)
    far: int = whole(1, 62, "", "Farthest slave", default=1, at_most="slaves")
    kind: str = choice(["line", "star"], "Topology", default="line")
    closed: bool = switch("Whether the ends are joined", default=False)
    name: str = text("Name", default="", most=5)
    limit: float | None = number(0, 1, "", "Limit", default=None, optional=True)
    noise: float = number(0, 10, "V", "Noise", default=0.0, missing=True)

    def __post_init__(self):
        check_fields(self)
        if self.kind == "star" and self.closed:
            raise ArgumentError("a star cannot be closed")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"length": -1}, "length is -1 m; it must be 0..500 m"),
        ({"length": "x"}, "length is 'x'; it must be 0..500 m"),
        ({"length": True}, "length is True; it must be 0..500 m"),
        ({"length": 10**400}, r"length is 10+ \.\.\. 0+; it must be 0..500 m"),
        ({"slaves": 2.5}, "slaves is 2.5; it must be a whole number 1..62"),
        ({"slaves": 3, "far": 4}, "far is 4; it must be a whole number 1..3, because slaves is 3"),
        ({"kind": "ring"}, "kind is 'ring'; it must be one of 'line', 'star'"),
        ({"closed": 1}, "closed is 1; it must be True or False"),
        ({"name": 5}, "name is 5; it must be text"),
        ({"name": "abcdef"}, "name has 6 characters; the limit is 5"),
        ({"limit": 2}, "limit is 2; it must be 0..1"),
        ({"kind": "star", "closed": True}, "a star cannot be closed"),
    ],
)
def test_a_record_refuses_illegal_values(given, message):
    with pytest.raises(ArgumentError, match=f"^{message}" if given != {} else message):
        Line(**{"length": 1.0} | given)


def test_a_record_stores_python_numbers():
    line = Line(np.float32(2), np.int16(5), noise=np.float64("nan"))
    assert (type(line.length), type(line.slaves), type(line.noise)) == (float, int, float)
    assert line.limit is None


def test_the_docstring_lists_the_declared_fields():
    assert "length : float\n    Length of the cable, 0..500 [m]." in Line.__doc__
    assert "slaves : int, default 31\n    Number of slaves, 1..62." in Line.__doc__
    places = [Line.__doc__.index(title) for title in ("Parameters", "Raises", "Examples")]
    assert places == sorted(places)
    names = "length slaves far kind closed name limit noise".split()
    assert list(declared(Line)) == names


def test_checks_of_arguments_name_value_and_range():
    assert check_scalar("dt", 5, "s", 0, 10) == 5.0
    for three in (np.int64(3), 3.0, np.float32(3)):
        assert repr(check_whole("n", three, 0, 10)) == "3"
    for call in (
        lambda: check_scalar("dt", [1.0, 2.0], "s", 0, 10),
        lambda: check_scalar("dt", None, "s", 0, 10),
        lambda: check_scalar("dt", float("inf"), "s", 0, 10),
        lambda: check_quantity("r", [], "ohm", high=1),
        lambda: check_quantity("r", [0.5, 2], "ohm", high=1),
        lambda: check_whole("n", True, 0, 10),
        lambda: check_whole("n", 3.5, 0, 10),
        lambda: check_whole("n", float("nan"), 0, 10),
        lambda: check_whole("n", float("inf"), 0, 10),
        lambda: check_whole("n", 11, 0, 10, ", because m is 10"),
    ):
        with pytest.raises(ArgumentError, match="it must be"):
            call()


@pytest.mark.parametrize("times", [(1, 1), (2, 1), (-1, 1), (float("nan"), 1), (float("inf"),)])
def test_a_fault_must_end_after_it_begins(times):
    with pytest.raises(ArgumentError):
        Fault(**dict(zip(("start", "stop"), times, strict=False)))


def test_one_fault_or_several_of_the_right_kind():
    class Other(Fault):
        """Another kind."""

    assert as_faults(Fault()) == (Fault(),)
    assert as_faults([]) == ()
    with pytest.raises(ArgumentError, match="must be one of Other"):
        as_faults([Fault()], Other)
    with pytest.raises(ArgumentError, match="'x'"):
        as_faults("x")


def test_every_record_checks_its_fields():
    for file in (Path(__file__).parents[2] / "shipnet").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and "record" in map(_name, node.decorator_list):
                for member in node.body:
                    if isinstance(member, ast.FunctionDef) and member.name == "__post_init__":
                        names = {_name(one) for one in ast.walk(member)}
                        checks = {"check_fields", "__post_init__"}
                        assert names & checks, f"{file.name}: {node.name}"


def _name(node):
    """Return the last name of a function, of a call or of an attribute."""
    node = node.func if isinstance(node, ast.Call) else node
    return getattr(node, "attr", getattr(node, "id", ""))


def test_an_array_without_dimensions_is_a_number():
    assert check_scalar("x", np.array(0.5), "V", 0, 1) == 0.5
    for wrong in (np.array(True), np.array([0.5]), np.array("1"), np.array(np.nan)):
        with pytest.raises(ArgumentError, match="x is"):
            check_scalar("x", wrong, "V", 0, 1)
