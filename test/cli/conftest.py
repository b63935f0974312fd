from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.cli.main import main
from wrist_stiffness.lookup.operators import pack
from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.lookup.table_file import load_table, save_table
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.shipped import shipped_file


@pytest.fixture
def refused(capsys):
    """Return a function that runs a command that must be refused, and gives its one line."""

    def run(*arguments):
        capsys.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as wrong_use:
            code = wrong_use.code
        out, err = capsys.readouterr()
        assert (code, err.count("\n"), "Traceback" in err) == (2, 1, False), err
        assert err.startswith("wrist-stiffness: error: ")
        return err

    return run


@pytest.fixture(scope="session")
def small_table(tmp_path_factory):
    """The shipped parts on the paper's 25 poses, with the true errors stated: a good table."""
    sweep = pytest.importorskip("wrist_stiffness.fem.sweep", reason="table check needs the mesher")
    shipped = load_table(shipped_file("precomputed/palmieri2015.npz"))
    nodes = shipped.workspace.grid(5)
    configuration = shipped.mechanism.forward(nodes)
    geometry, components = shipped.geometry, shipped.components
    table = replace(
        shipped,
        header=replace(shipped.header, per_axis=5),
        nodes=nodes,
        operators=pack(contact_operators(configuration, components, geometry.gravity)),
        map_values=rated_map(
            configuration, contact_operators(configuration, components, np.zeros(3)), geometry
        ),
    )
    errors = {**table.header.errors, "predicted": sweep.interpolation_errors(table)}
    path = tmp_path_factory.mktemp("tables") / "small.npz"
    return save_table(replace(table, header=replace(table.header, errors=errors)), path), path
