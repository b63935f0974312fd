"""Long arrays a piece at a time."""

import numpy as np
import pytest

from wrist_stiffness.sessions import in_pieces as pieces


@pytest.mark.parametrize("rows", [0, 1, 6, 7, 8, 20])
def test_pieces_give_what_all_rows_give(monkeypatch, rows):
    monkeypatch.setattr(pieces, "ROWS", 7)
    generator = np.random.default_rng(rows)
    matrices, vectors = generator.normal(size=(rows, 3, 3)), generator.normal(size=(rows, 3))
    given = []

    def turned(matrix, vector):
        given.append(len(matrix))
        return (matrix @ vector[..., None])[..., 0]

    found = pieces.in_pieces(turned, matrices, vectors)
    np.testing.assert_array_equal(found, (matrices @ vectors[..., None])[..., 0])
    assert max(given) <= 7
    assert sum(given) == rows
