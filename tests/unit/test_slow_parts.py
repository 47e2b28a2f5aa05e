"""Every file with slow tests belongs to one part, and each part has its day."""

from __future__ import annotations

import re

import pytest
from slow_parts import PARTS, TESTS, files, of_day

SLOW = re.compile(r"pytest\.mark\.slow\b")


def test_every_file_with_slow_tests_is_in_one_part() -> None:
    found = {
        str(path.relative_to(TESTS))
        for path in TESTS.rglob("test_*.py")
        if SLOW.search(path.read_text())
    }
    named = [name for names in PARTS.values() for name in names]
    assert len(named) == len(set(named))
    assert found - {"unit/test_slow_parts.py"} == set(named)


def test_each_part_has_its_day() -> None:
    assert {of_day(day) for day in range(1, 1 + len(PARTS))} == set(PARTS)


def test_all_parts_together_are_all_files() -> None:
    assert sorted(files("")) == sorted(one for part in PARTS for one in files(part))
    with pytest.raises(KeyError):
        files("nothing")
