"""Tables beside the benchmark: what is asked once stays, and orders are what they say."""

import json
from types import SimpleNamespace

import numpy as np
import pytest


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


def test_an_order_is_exact_above_its_limit_and_usual_below(bench, monkeypatch):
    much = bench("how_much")
    usual = {"a": 5.0, "b": 4.0, "c": 3.0, "d": 2.0}
    monkeypatch.setattr(much, "usual_sizes", lambda riddle, words: SimpleNamespace(suspects=usual))
    # The usual order is just the wrong way round.
    added = np.array([0.1, 0.3, 0.7, 3.0])
    ranks = much._ranks(SimpleNamespace(parts=dict.fromkeys("abcd")), None, added)
    by_limit = {limit: ranks[much._order(limit)] for limit in (0.2, 0.5, 1.0, np.inf)}
    # Orders of a, b, c, d: exact; d, c, a, b; d, a, b, c; a, b, c, d of which d is the largest.
    assert by_limit == pytest.approx({0.2: 1.0, 0.5: 0.8, 1.0: 0.2, np.inf: -1.0})


def test_table_tells_medians_and_leaves_failures_out(bench):
    much = bench("how_much")
    lines = [
        *({"told": "largest 3", "after": after} for after in (1.0, 2.0, 6.0)),
        {"told": "largest 3", "error": "no equilibrium"},
        {"told": much._order(0.5), "rank": 0.75},
    ]
    rows = much.table(lines).splitlines()[2:]
    assert rows == [
        "| largest 3 | 3 | 2.00 | 1.00 | 6.00 |",
        f"| {much._order(0.5)} | 1 | 0.75 | 0.75 | 0.75 |",
    ]
