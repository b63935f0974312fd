"""Tables beside the benchmark: what is asked once stays, and orders are what they say."""

import json
from types import SimpleNamespace


def counted(case):
    """Answer a case; also in another process."""
    return [{"key": case.key, "version": "now", "told": case.key.upper()}]


def test_a_second_start_asks_what_is_missing_and_old_versions_do_not_count(bench, tmp_path):
    kept = bench("kept_lines")
    path = tmp_path / "new" / "lines.jsonl"
    path.parent.mkdir()
    held = [
        {"key": "a", "version": "now", "told": "kept"},
        {"key": "b", "version": "before", "told": "old"},
    ]
    path.write_text("".join(json.dumps(line) + "\n" for line in held))
    cases = [SimpleNamespace(key=key) for key in "abc"]
    found = kept.asked(counted, cases, path, "now", 2)
    assert sorted((line["key"], line["told"]) for line in found) == [
        ("a", "kept"),
        ("b", "B"),
        ("c", "C"),
    ]
    assert len(path.read_text().splitlines()) == 4
    assert kept.asked(counted, cases, path, "now", 2) == [
        line for line in map(json.loads, path.read_text().splitlines()) if line["version"] == "now"
    ]
    assert len(path.read_text().splitlines()) == 4
