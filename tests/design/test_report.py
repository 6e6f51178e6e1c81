"""The report is self-contained and reproducible, and text of a user never becomes markup."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from shipnet.__main__ import main
from shipnet.design.comparison import compare
from shipnet.design.costs import EXCLUDED
from shipnet.design.iolist import IoList
from shipnet.design.report import BANNER, document, table
from tests.design.lists import ship, small_loop

VOID = {"meta", "img", "br", "hr", "link", "input"}
HOSTILE = ["<script>alert(1)</script>", '"><img src=x onerror=y>', "&amp;$x^2$", "' onload='z"]


class Page(HTMLParser):
    """A parser that checks that tags are closed in order, and keeps the text and attributes."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.attributes, self.words = [], [], [], []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(self.words)


def pictures(page):
    return [
        base64.b64decode(data).decode()
        for data in re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', page)
    ]


@pytest.fixture(scope="module")
def comparison():
    return compare([small_loop(), small_loop(redundant=True)], rng=np.random.default_rng(1))


@pytest.fixture(scope="module")
def page(comparison):
    return comparison.html()


def test_a_report_loads_no_files_and_runs_no_scripts(comparison, page):
    parsed = Page(page)
    assert page.startswith("<!DOCTYPE html>")
    assert {"script", "link", "iframe", "object", "form"}.isdisjoint(parsed.tags)
    for name, value in parsed.attributes:
        assert not name.startswith("on")
        if name in ("src", "href", "srcset", "data", "action"):
            assert value.startswith(("data:image/svg+xml;base64,", "#annex-"))
    assert "http:" not in page and "https:" not in page and "url(" not in page
    assert "@import" not in page
    figures = pictures(page)
    assert len(figures) == 4 + len(comparison.designs)  # each with a drawing of one sheet
    for figure in figures:
        assert "<svg" in figure and "<script" not in figure
        assert not re.findall(r'href="(?!#)', figure)


def test_the_first_page_says_that_it_is_not_an_approval(page):
    words = Page(page).text
    assert words.index(BANNER) < words.index("The designs side by side")
    assert BANNER == "A design aid, not class approval."


def test_everything_that_was_assumed_and_every_rule_is_in_the_report(comparison, page):
    words = Page(page).text
    for takes in comparison.quantities.values():
        for name, source in takes.assumptions[["name", "source"]].values:
            assert name.replace("_", " ") in words and source in words
    assert all(line in words for line in EXCLUDED)
    for row in comparison.findings().table().itertuples():
        assert row.source in words and row.clause in words and row.why in words
    for tag in comparison.iolist.points["tag"]:
        assert tag in words


def test_the_contents_link_to_every_annex_after_the_main_pages(page):
    targets = re.findall(r'<a href="#(annex-[A-Z])">(Annex [A-Z]: [^<]+)</a>', page)
    heads = re.findall(r'<section id="(annex-[A-Z])">\n<h2>([^<]+)</h2>', page)
    assert targets == heads and len(heads) == 9
    assert page.index("side by side") < page.index("Figures") < page.index("Contents")
    assert page.index("Contents") < page.index(heads[0][1] + "</h2>")


def test_a_long_list_has_its_points_in_the_tables_and_a_bounded_report():
    # 25 pages of A4 for 1 000 points: a page takes about 45 rows, or one sheet of a drawing.
    found = ship(1000).compare((20, 0, 4), ["home runs", "junction boxes", "CAN", "Modbus RTU"])
    page = found.html()
    assert "contain all 1000 points" in Page(page).text
    assert page.count("<tr>") < 420
    assert len(pictures(page)) <= 4 + 2 * len(found.designs)
    for option, design in found.designs.items():
        assert design.tables()["points"]["tag"].tolist() == found.iolist.points["tag"].tolist()
        named = "".join(pictures(page)[4:])
        boxes = design.devices.query("kind == 'station' or kind == 'box'")["device"]
        assert all(f">{name}<" in named for name in boxes), option


def test_the_same_comparison_gives_the_same_bytes(comparison, page, tmp_path):
    again, dated = tmp_path / "a.html", tmp_path / "b.html"
    designs = [small_loop(), small_loop(redundant=True)]
    compare(designs, rng=np.random.default_rng(1)).report(again)
    remarked = replace(comparison, remarks=("the cabinet is guessed",))
    remarked.report(dated, date="2026-11-21")
    assert again.read_bytes() == page.encode()
    assert "2026-11-21" not in page and b"2026-11-21" in dated.read_bytes()
    assert b"The cabinet is guessed." in dated.read_bytes()


def test_text_of_a_list_never_becomes_markup():
    small = small_loop()
    words = dict.fromkeys(("tag", "system", "note"), HOSTILE)
    table_ = pd.DataFrame({**words, "signal": "contact", "x": [5.0, 6, 7, 8], "y": 1.0, "z": 1.0})
    hostile = IoList.from_table(table_, source="<b>list</b>.csv")
    found = hostile.compare(small.site, ["home runs", "Modbus RTU"])
    page = replace(found, remarks=("<u>",)).html(title="<i>$1</i>", date="</title>")
    parsed = Page(page)
    assert {"script", "b", "i", "u"}.isdisjoint(parsed.tags)
    assert not any(name.startswith("on") for name, _ in parsed.attributes)
    assert all(tag in parsed.text for tag in found.iolist.points["tag"])
    assert parsed.tags.count("title") == 1


def test_an_option_with_a_dollar_or_a_tag_in_its_name_is_drawn_as_it_is():
    small = small_loop()
    odd = replace(small, name="$a_{<script>")
    page = compare([small, odd]).html()
    assert "script" not in Page(page).tags


#: A list with a point that is too far away for a bus.
FAR = IoList.parse("tag,signal,x,y,z\nA,contact,5,0,0\nB,contact,900,0,0")


def test_points_that_do_not_fit_are_listed_with_their_reason(page):
    found = FAR.compare((0, 0, 4), ["home runs", "AS-i"], rng=np.random.default_rng(1))
    words = Page(found.html()).text
    assert found.table()["points_left_out"].tolist() == [0, 1]
    assert "AS-i leaves out 1 of 2 points: B " in words
    assert all(reason in words for reason in found.reasons()["text"])
    assert "does not fit" in words and "(2 DI) of text, in no system." in words
    assert "Every point fits in every option." in Page(page).text
    named = ["AS-i (1 left out)" in figure for figure in pictures(found.html())[:4]]
    assert named == [True, True, True, False]  # the last one compares complete options only
    none = FAR.compare(small_loop().site, ["AS-i", "CAN"]).html()
    assert len(pictures(none)) == 3 + 2  # and a drawing of each design
    assert "Effect of each assumption" not in none


def test_only_a_verdict_is_coloured():
    cells = table(["tag", "rule"], [["violated valve", "violated"]], verdicts=[1])
    assert "<td>violated valve</td>" in cells
    assert '<td class="k fail">violated</td>' in cells
    small = small_loop()
    renamed = small.iolist.points.assign(
        tag=["met 1", "violated 2", "violated 3", "not verified 4"]
    )
    page = IoList.from_table(renamed).compare(small.site, ["home runs"]).html()
    coloured = re.findall(r'<td class="[^"]*(?:pass|fail|open)[^"]*">([^<]*)', page)
    assert coloured and not [cell for cell in coloured if re.search(r"\d$", cell)]


def test_pieces_of_a_page_are_escaped():
    assert Page(document("a<b", table(["<p>"], [["<td>"]], caption="<c>"))).tags.count("td") == 1


LIST = "tag,signal,system,x,y,z,home run\n" + "\n".join(
    f"LS-{n},contact,Bilge,{10 + 3 * n},{n % 3},{n % 2},{round(1.15 * (10 + 4 * n) + 5, 1)}"
    for n in range(8)
)


def test_the_command_prints_a_table_and_writes_a_report(tmp_path, capsys):
    points, report = tmp_path / "points.csv", tmp_path / "report.html"
    points.write_text(LIST, encoding="utf-8")
    command = ["design", str(points), "-o", str(report), "--options", "home runs, CAN"]
    command += ["--mix", "DI=modbus rtu doubled", "--cabinet", "0,0,0", "--date", "today"]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert out.startswith("8 points (8 DI) of points.csv\n")
    (head,) = [line for line in out.splitlines() if line.startswith("design ")]
    assert head.split() == ["design", "home", "runs", "CAN", "mix"]
    assert "total cost [EUR]" in out and "design aid, not class approval" in out.lower()
    page = Page(report.read_text(encoding="utf-8"))
    assert "points.csv" in page.text and "today" in page.text
    assert str(tmp_path) not in page.text


def test_the_command_finds_the_cabinet_and_says_so(tmp_path, capsys):
    points = tmp_path / "points.csv"
    points.write_text(LIST, encoding="utf-8")
    assert main(["design", str(points), "--options", "home runs"]) == 0
    assert "the cabinet is assumed to be at" in capsys.readouterr().out


def test_the_command_says_if_listed_home_runs_differ_from_computed_ones(tmp_path, capsys):
    points = tmp_path / "points.csv"
    points.write_text(LIST, encoding="utf-8")
    command = ["design", str(points), "--options", "home runs,CAN", "--cabinet"]
    said = "Home runs have the lengths in the list, 0.261 km in total for 8 points; computed from"
    assert main([*command, "0,0,0"]) == 0
    assert said not in capsys.readouterr().out
    assert main([*command, "60,0,0"]) == 0
    assert f"{said} positions, with the cabinet at 60, 0, 0 m, the total" in capsys.readouterr().out


def test_a_list_without_places_has_no_position_of_the_cabinet(tmp_path, capsys):
    points, report = tmp_path / "points.csv", tmp_path / "report.html"
    points.write_text("tag,type,home run\nA,DI,30\n", encoding="utf-8")
    assert main(["design", str(points), "--options", "home runs", "-o", str(report)]) == 0
    assert "Cabinet at" not in Page(report.read_text(encoding="utf-8")).text
    text = "tag,type,home run,box,box x,box y,box z,to box\nA,DI,30,J,50,0,0,4\n"
    points.write_text(text, encoding="utf-8")
    assert main(["design", str(points), "--options", "home runs"]) == 2
    assert "give its position x, y, z in m" in capsys.readouterr().err


MISTAKES = """\
nowhere.csv|nowhere.csv: cannot be read
LIST --cabinet 1,2|cabinet is '1,2'; it must be three numbers
LIST --cabinet 1,2,nan|cabinet is
LIST --mix DI|--mix is 'DI'; it must be WHAT=OPTION, such as DI=AS-i
LIST --mix DI=CAN --mix DI=AS-i|--mix assigns 'DI' to both CAN and AS-i
LIST --mix XX=CAN|mix names 'XX'; it is not a tag, signal, system, category or
LIST --mix DI=DALI|--mix names 'DALI'; it must be one of home runs
LIST --rules KR|rules is 'KR'; it must be one of DNV
LIST --rules own.csv|own.csv: cannot be read
LIST --options DALI|--options names 'DALI'; it must be one of home
LIST --settings own.toml|own.toml: cannot be read
--settings own.toml --show-settings|own.toml: cannot be read
|no LIST is given
LIST --options CAN,CAN|--options lists CAN twice
LIST --sheet S|has no sheet 'S'
LIST -o /nowhere/at/all.html|all.html'; there is no folder"""


@pytest.mark.parametrize(("words", "message"), [m.split("|") for m in MISTAKES.splitlines()])
def test_a_mistake_is_reported_in_one_line(words, message, tmp_path, capsys):
    arguments = words.split()
    points = tmp_path / "points.csv"
    points.write_text(LIST, encoding="utf-8")
    options = [] if "--options" in arguments else ["--options", "home runs"]
    given = [str(points) if word == "LIST" else word for word in arguments]
    assert main(["design", *given, *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_help_has_an_example(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["design", "--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert "examples:" in out and "shipnet design points.csv -o report.html" in out
