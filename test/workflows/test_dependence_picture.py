import numpy as np

from wrist_stiffness.workflows.pictures.dependence import Against, draw_against


def test_equal_conditions_are_one_point():
    """Rests know two sides of approach; a mean over a reversal lies between."""
    rng = np.random.default_rng(0)
    sides = np.repeat([-0.5, -0.1, 0.1, 0.5], [40, 3, 2, 40]) + rng.uniform(0, 1e-12, 85)
    figure = draw_against([Against("", "side", "phi", sides, [("bare", rng.normal(size=85))])])
    centres = figure.axes[0].containers[0].lines[0].get_xdata()
    assert np.isclose(centres, 0.5).sum() == 1
    assert np.isclose(centres, -0.5).sum() == 1
