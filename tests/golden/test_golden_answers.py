"""The JSON of every command and the text of its page are those of the golden files (see `answers.py`)."""

import json

import pytest

from tests.golden.answers import CASES, HERE, answer, changed_lines, differences

MARKED = [pytest.param(name, marks=pytest.mark.slow) if case.get("slow") else name for name, case in CASES.items()]


@pytest.mark.parametrize("name", MARKED)
def test_golden_answer(name):
    found, page = answer(name)
    was = json.loads((HERE / "answers" / f"{name}.json").read_text(encoding="utf-8"))
    within = CASES[name].get("within", 2e-5)
    assert differences(was, found, within) == []
    if CASES[name].get("page"):
        kept = (HERE / "pages" / f"{name}.txt").read_text(encoding="utf-8")
        assert changed_lines(kept, page, CASES[name].get("on_page", max(within, 5e-3))) == []
