"""Real measured files into records, as a person would bring them in."""

from pathlib import Path

from studies.cli import main

DATA = Path("tests/reference/measured")


def bring_in(raw, folder, *edits, preview=False):
    """Draft a map, correct it, import; return the path of the record."""
    draft, run = folder / "map.toml", folder / "run.csv"
    assert main(["import", str(DATA / raw), "--draft", str(draft)]) == 0
    text = draft.read_text(encoding="utf-8")
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    draft.write_text(text, encoding="utf-8")
    seen = ["--report", str(folder / "preview.html")] if preview else []
    assert main(["import", str(DATA / raw), "--map", str(draft), "--out", str(run), *seen]) == 0
    return run
