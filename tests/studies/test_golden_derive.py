"""Golden: the shape of `hrg derive --json`, schema hrg.derive/1. A change here needs a new schema number."""

import json

from studies.cli import main

KEYS = [
    "schema",
    "harmonic",
    "pole_angle_deg",
    "rim_angle_deg",
    "I",
    "J",
    "bryan_factor",
    "d_ln_f_d_rim_angle_per_rad",
    "equations",
    "code",
]
NUMBERS = ["1", "2", "3", "4", "5", "6", "7", "8", "8 as printed", "9", "10", "11", "12", "13", "14", "15"]


def test_schema_of_derive_is_kept(capsys):
    assert main(["derive", "--json", "--code", "c"]) == 0
    payload = json.loads(capsys.readouterr().out)
    assert list(payload) == KEYS
    assert payload["schema"] == "hrg.derive/1"
    assert all(list(payload[name]) == ["closed_form", "value"] for name in ("I", "J", "bryan_factor"))
    assert [step["number"] for step in payload["equations"] if step["number"]] == NUMBERS
    assert all(list(step) == ["number", "title", "latex", "plain"] for step in payload["equations"])
    assert list(payload["code"]) == ["language", "text"]
