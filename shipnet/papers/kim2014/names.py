"""Names, numbers of headings, and the standards that the paper refers to."""

from __future__ import annotations

from shipnet import datasets
from shipnet.papers.registry import check

__all__ = ["SECTIONS", "SUBJECTS", "captions"]

#: Numbers of the headings, in order.
SECTIONS = (
    "1", "2", "2.1", "2.2", "2.3", "3", "3.1", "3.2", "3.2", "3.3", "3.4", "3.5", "4", "5",
)  # fmt: skip

#: What the standards for environmental tests are about: the title of IEC 60945 and of
#: IEC 60092-504, and the subject of the class societies' unified requirement E10.
SUBJECTS = {
    "IEC 60945": "maritime navigation and radiocommunication equipment",
    "IEC 60092-504": "electrical installations in ships: automation, control and instrumentation",
    "IACS UR E10": "type tests of a ship's equipment for control, monitoring and automation",
}


def captions() -> tuple[str, ...]:
    """Return the numbers of the tables, as their captions have them.

    Returns
    -------
    tuple of str
        In the order of the paper.

    Examples
    --------
    >>> captions()
    ('Table 1', 'Table 2', 'Table 3', 'Table 1')
    """
    items = datasets.read("figures_tables.csv").query("paper == 'kim2014'")["item"]
    return tuple(item.split(" (")[0] for item in items if item.startswith("Table"))


@check("kim2014-042", counter={"sections": tuple(dict.fromkeys(SECTIONS))})
def sections_are_unique(*, sections: tuple[str, ...] = SECTIONS) -> bool:
    """Whether no two headings have the same number."""
    return len(set(sections)) == len(sections)


@check("kim2014-043", counter={"tables": ("Table 1", "Table 2", "Table 3", "Table 4")})
def tables_are_unique(*, tables: tuple[str, ...] = ()) -> bool:
    """Whether no two tables have the same number."""
    numbers = tables or captions()
    return len(set(numbers)) == len(numbers)


@check("kim2014-046", counter={"standard": "IACS UR E10"})
def is_about_automation(*, standard: str = "IEC 60945") -> bool:
    """Whether the standard is about the automation of a ship's machinery."""
    return "automation" in SUBJECTS[standard]


@check("kim2014-063", counter={"flag": "MotHighTemp"})
def flag_names_the_motor(*, flag: str = "") -> bool:
    """Whether the flag of O1 begins with the beginning of the word motor."""
    rules = datasets.read("kim2014_rule_table.csv").set_index("code")
    name = flag or str(rules.loc["O1", "flag_printed"])
    return "motor".startswith(name[:3].lower())
