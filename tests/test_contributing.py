"""The map from ideas to files in CONTRIBUTING.md leads somewhere."""

import re
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
TEXT = (CHECKOUT / "CONTRIBUTING.md").read_text("utf-8")


def ideas() -> dict[str, str]:
    table = TEXT.split("## Where do I find …")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| ([^|]+) \| `([^`]+)` \|$", table, flags=re.MULTILINE))


def test_the_map_holds_twenty_ideas_each_with_a_file_of_its_own() -> None:
    assert len(ideas()) >= 20
    assert len(set(ideas().values())) == len(ideas())


def test_each_idea_leads_to_a_file() -> None:
    missing = {idea: file for idea, file in ideas().items() if not (CHECKOUT / file).is_file()}
    assert missing == {}


def test_the_table_of_packages_names_every_part_and_none_that_is_not_there() -> None:
    rows = re.findall(r"^\| `(\w+)/` \|[^|]+\|([^|]+)\|$", TEXT, flags=re.MULTILINE)
    for package, parts in rows:
        named = set(re.findall(r"`([\w.]+)`", parts))
        there = {
            one.name
            for one in (CHECKOUT / package).iterdir()
            if not one.name.startswith(("_", ".")) and (one.is_dir() or one.suffix == ".py")
        }
        assert not named or named == there, package


def test_files_named_elsewhere_in_it_exist() -> None:
    for file in re.findall(r"`((?:estimator|mmslam|scenes|simulator|validation)/[\w/.]+)`", TEXT):
        assert (CHECKOUT / file).exists(), file
