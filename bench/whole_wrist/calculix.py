"""A pose of the whole wrist as a CalculiX job: a solver that nobody here wrote.

Rigid frames, slides and the contact sectors found closed are linear equations of the deck; own
weight is CalculiX's own.  Units of the deck: N, mm, t, s.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from whole_wrist.model import FRAMES, SCREWS, WristAtPose, platform_weight
from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError
from wrist_stiffness.fem.elasticity import rigid_motion
from wrist_stiffness.fem.solids import MILLIMETRES
from wrist_stiffness.mechanism.components import PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.material import AnyMaterial, Material, OrthotropicMaterial
from wrist_stiffness.mechanism.modes import RigidBody

TONNES = 1e-3
"""Of a kilogram."""

MEGAPASCALS = 1e-6

NEGLIGIBLE = 1e-13
"""Coefficients of an equation below this are rounding."""

TIME_LIMIT_S = 1800.0


def write_deck(
    model: WristAtPose,
    path: Path,
    wrench: Array,
    gravity: Array,
    closed: NDArray[np.bool_],
) -> None:
    """Write the CalculiX deck of a pose.

    Parameters
    ----------
    model : WristAtPose
        The pose.
    path : Path
        The deck, `*.inp`.
    wrench : (6,) float
        On the platform at O in F [N, N m].
    gravity : (3,) float
        Acceleration field in F [m/s^2].
    closed : (m,) bool
        Flange sectors in contact; their gaps are held at zero.
    """
    with replacing(path) as written, written.open("w") as deck:
        for lines in (_wrist(model, closed), _static_step(model, wrench, gravity, closed)):
            deck.writelines(line + "\n" for line in lines)


def write_modal_deck(
    model: WristAtPose,
    path: Path,
    bodies: tuple[RigidBody, ...],
    closed: NDArray[np.bool_],
    count: int = 6,
) -> None:
    """Write the CalculiX deck of a pose's natural modes, motors locked.

    Parameters
    ----------
    model : WristAtPose
        The pose.
    path : Path
        The deck, `*.inp`.
    bodies : tuple of RigidBody
        What moves with the platform: its plate, and a payload.
    closed : (m,) bool
        Flange sectors that stay in touch.
    count : int
        Modes.
    """
    with replacing(path) as written, written.open("w") as deck:
        for lines in (_wrist(model, closed), _modal_step(model, bodies, closed, count)):
            deck.writelines(line + "\n" for line in lines)


def run_deck(path: Path) -> Array:
    """Run CalculiX on a deck of `write_deck` and read the platform's twist.

    Parameters
    ----------
    path : Path
        The deck, `*.inp`; results are written beside it.

    Returns
    -------
    (6,) float
        Twist of the platform at O in F [m, rad].

    Raises
    ------
    InputError
        If `ccx` is not installed or ends with an error.
    """
    moved = {int(row[0]): row[1:] for row in _run(path) if len(row) == 4 and row[0].isdigit()}
    if len(moved) != 2:
        raise InputError(f"ccx wrote no platform displacement into {path.with_suffix('.dat').name}")
    shift, turn = (np.array(moved[node], dtype=float) for node in sorted(moved))
    return np.concatenate([shift / MILLIMETRES, turn])


def run_modal_deck(path: Path) -> Array:
    """Run CalculiX on a deck of `write_modal_deck` and read the natural frequencies, (k,) [Hz].

    Raises
    ------
    InputError
        If `ccx` is not installed or ends with an error.
    """
    rows = [row for row in _run(path) if len(row) == 5 and row[0].isdigit()]
    return np.array([row[3] for row in rows], dtype=float)


def _run(path: Path) -> list[list[str]]:
    """Run CalculiX and return the words of the lines of its results."""
    solver = shutil.which("ccx")
    if solver is None:
        raise InputError("the solver ccx is not installed (Debian package calculix-ccx)")
    job = subprocess.run(
        [solver, "-i", path.stem],
        cwd=path.parent,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT_S,
        check=False,
    )
    results = path.with_suffix(".dat")
    if job.returncode != 0 or not results.is_file():
        last = [line for line in job.stdout.splitlines() if line.strip()][-1:]
        raise InputError(f"ccx failed on {path.name}: {' '.join(last).strip()}")
    return [line.split() for line in results.read_text().splitlines()]


def _wrist(model: WristAtPose, closed: NDArray[np.bool_]) -> Iterator[str]:
    """Nodes, elements, frames and contact sectors, before any step."""
    first, own, gap_node = _numbers(model)

    yield "*NODE, NSET=ALL"
    for part, start in zip(model.placed, first, strict=False):
        for number, place in enumerate(part.nodes * MILLIMETRES, int(start)):
            yield f"{number}," + ",".join(map(_number, place))
    for number in range(own, gap_node + len(closed)):
        yield f"{number},0.,0.,0."
    yield from _elements(model, first)
    yield from _wall_equations(model, first, own)
    yield "*BOUNDARY"
    for part, start in zip(model.placed, first, strict=False):
        if part.name in ("joint_1", "joint_5"):
            yield from (f"{int(start) + node},1,3" for node in np.unique(part.motor_wall // 3))
    yield from (f"{gap_node - len(PASSIVE_JOINTS) + k},3" for k in range(len(PASSIVE_JOINTS)))
    yield from (f"{gap_node + sector},2,3" for sector in range(len(closed)))
    yield from (f"{gap_node + sector},1" for sector in np.flatnonzero(~closed))
    yield from _contact_equations(model, first, own, closed)


def _numbers(model: WristAtPose) -> tuple[NDArray[np.int64], int, int]:
    """First node of each part, of the frames and of the sectors' gaps."""
    counts = [len(part.nodes) for part in model.placed]
    first = 1 + np.concatenate([[0], np.cumsum(counts)])
    # Two nodes per frame (shift at O, turn), one per passive joint (slide, turn), one per sector
    # (its gap): nodes of no element, whose degrees of freedom the equations give a meaning.
    own = int(first[-1])
    return first, own, own + 2 * len(FRAMES) + len(PASSIVE_JOINTS)


def _static_step(
    model: WristAtPose, wrench: Array, gravity: Array, closed: NDArray[np.bool_]
) -> Iterator[str]:
    _, own, gap_node = _numbers(model)
    platform = own + 2 * FRAMES.index("platform")
    yield "*NSET, NSET=PLATFORM"
    yield f"{platform},{platform + 1}"
    yield "*STEP"
    yield "*STATIC"
    for sector in np.flatnonzero(closed):
        yield "*BOUNDARY"
        yield f"{gap_node + sector},1,1,{_number(-MILLIMETRES * model.gaps[sector])}"
    yield "*CLOAD"
    load = (wrench + platform_weight(model, gravity)) * np.repeat([1.0, MILLIMETRES], 3)
    for k, value in enumerate(load):
        yield f"{platform + k // 3},{k % 3 + 1},{_number(value)}"
    size = float(np.linalg.norm(gravity))
    if size > 0.0:
        direction = ",".join(map(_number, gravity / size))
        yield "*DLOAD"
        yield from (
            f"{part.name.upper()},GRAV,{_number(MILLIMETRES * size)},{direction}"
            for part in model.placed
        )
    yield "*NODE PRINT, NSET=PLATFORM"
    yield "U"
    yield "*END STEP"


def _modal_step(
    model: WristAtPose, bodies: tuple[RigidBody, ...], closed: NDArray[np.bool_], count: int
) -> Iterator[str]:
    """Rigid bodies as six points each, with their mass, centre and inertia; then the modes."""
    _, own, gap_node = _numbers(model)
    node = gap_node + len(closed)
    solid = sum(len(part.body.mesh.elements) for part in model.placed)
    for number, body in enumerate(bodies):
        axes = np.linalg.eigh(body.inertia)[1] * np.sqrt(3.0 * body.second_moments / body.mass)
        places = body.centre + np.concatenate([axes.T, -axes.T])
        places = MILLIMETRES * places @ model.configuration.platform.T
        numbers = range(node, node := node + len(places))
        yield "*NODE"
        for point, place in zip(numbers, places, strict=True):
            yield f"{point}," + ",".join(map(_number, place))
        yield f"*ELEMENT, TYPE=MASS, ELSET=BODY_{number}"
        yield from (f"{solid + point},{point}" for point in numbers)
        yield f"*MASS, ELSET=BODY_{number}"
        yield _number(body.mass * TONNES / len(places))
        motion = rigid_motion(places).reshape(-1, 3, 6)
        for point, rows in zip(numbers, motion, strict=True):
            for way, row in enumerate(rows):
                masters = np.flatnonzero(row)
                start = 6 * FRAMES.index("platform")
                terms = [(*_screw_dof(own, start + int(k)), -row[k]) for k in masters]
                yield from _equation([(point, way + 1, 1.0), *terms])
    yield "*BOUNDARY"
    yield from (f"{gap_node + sector},1" for sector in np.flatnonzero(closed))
    yield "*STEP"
    yield "*FREQUENCY"
    yield f"{count}"
    yield "*END STEP"


def _elements(model: WristAtPose, first: NDArray[np.int64]) -> Iterator[str]:
    start_element = 1
    for part, start in zip(model.placed, first, strict=False):
        elements = _right_handed(part.nodes, part.body.mesh.elements)
        yield f"*ELEMENT, TYPE=C3D10, ELSET={part.name.upper()}"
        for number, nodes in enumerate(elements + int(start), start_element):
            yield f"{number}," + ",".join(map(str, nodes))
        start_element += len(elements)
        material, name = part.body.solid.material, part.name.upper()
        section = f"*SOLID SECTION, ELSET={name}, MATERIAL=M_{name}"
        if isinstance(material, OrthotropicMaterial):
            # Two points of the axis that the material's axes turn about.
            turn = part.turn[:3, :3].toarray()
            origin = part.nodes[0] - turn @ part.body.mesh.nodes[0]
            axis = (*MILLIMETRES * origin, *(MILLIMETRES * origin + turn[:, 2]))
            yield f"*ORIENTATION, NAME=O_{name}, SYSTEM=CYLINDRICAL"
            yield ",".join(map(_number, axis))
            section += f", ORIENTATION=O_{name}"
        yield f"*MATERIAL, NAME=M_{name}"
        yield from _elasticity(material)
        yield "*DENSITY"
        yield _number(material.density * TONNES / MILLIMETRES**3)
        yield section


def _elasticity(material: AnyMaterial) -> Iterator[str]:
    if isinstance(material, Material):
        yield "*ELASTIC"
        yield f"{_number(material.young * MEGAPASCALS)},{_number(material.poisson)}"
        return
    young, shear = (MEGAPASCALS * np.array(moduli) for moduli in (material.young, material.shear))
    # Eight numbers have to fit into a line of 132 characters.
    constants = [f"{value:.8e}" for value in (*young, *material.poisson, *shear)]
    yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
    yield ",".join(constants[:8])
    yield constants[8]


def _right_handed(nodes: Array, elements: NDArray[np.int64]) -> NDArray[np.int64]:
    """Swap two corners, and the middles with them, where a tetrahedron is left-handed."""
    edges = nodes[elements[:, 1:4]] - nodes[elements[:, :1]]
    mirrored = elements[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    return np.where((np.linalg.det(edges) < 0.0)[:, None], mirrored, elements)


def _wall_equations(model: WristAtPose, first: NDArray[np.int64], own: int) -> Iterator[str]:
    """Nodes of a moving wall follow the frames: n u - sum of coefficients x unknowns = 0."""
    for part, start in zip(model.placed, first, strict=False):
        # A wall that follows as a whole follows in x, y and z; one that slides, along its normals.
        whole = sparse.csr_matrix(sparse.eye(3 * len(part.nodes)))
        for wall, screw, axes in (
            (part.motor_wall, part.motor_screw, whole),
            (part.platform_wall, part.platform_screw, part.axes),
        ):
            ways = sparse.csr_matrix(axes.T)
            motion = ways @ rigid_motion(part.nodes * MILLIMETRES)
            for unknown, row in zip(wall, motion[wall] @ screw, strict=True):
                masters = np.flatnonzero(np.abs(row) > NEGLIGIBLE)
                if len(masters) == 0:
                    continue
                way = slice(*ways.indptr[unknown : unknown + 2])
                terms = [
                    (int(start) + dof // 3, dof % 3 + 1, value)
                    for dof, value in zip(ways.indices[way], ways.data[way], strict=True)
                    if abs(value) > NEGLIGIBLE
                ]
                terms.sort(key=lambda term: -abs(term[2]))
                terms += [(*_screw_dof(own, int(k)), -row[k]) for k in masters]
                yield from _equation(terms)


def _contact_equations(
    model: WristAtPose, first: NDArray[np.int64], own: int, closed: NDArray[np.bool_]
) -> Iterator[str]:
    """Mean displacement of a closed sector against the hub = dof 1 of its gap node."""
    gap_node = own + 2 * len(FRAMES) + len(PASSIVE_JOINTS)
    inner = model.openings.shape[1] - SCREWS
    by_node = [
        (int(start), sparse.csr_matrix(model.openings[:, :inner] @ follow[:, :inner].T))
        for follow, start in zip(model.follow, first, strict=False)
    ]
    on_walls = [np.concatenate([part.motor_wall, part.platform_wall]) // 3 for part in model.placed]
    by_screw = model.openings[:, inner:].toarray()
    # Rows are per metre and radian; the deck's shifts are in millimetres.
    by_screw[:, [k for k in range(SCREWS) if _is_turn(k)]] *= MILLIMETRES
    for sector in np.flatnonzero(closed):
        terms = []
        for (start, rows), walls in zip(by_node, on_walls, strict=True):
            row = rows[sector].tocoo()
            # Dependent may be no node that another equation has a claim on.
            shared = np.isin(row.col // 3, walls) | (np.diff(rows.tocsc().indptr)[row.col] > 1)
            terms += [
                (start + dof // 3, dof % 3 + 1, value, bool(taken))
                for dof, value, taken in zip(row.col, row.data, shared, strict=True)
                if abs(value) > NEGLIGIBLE
            ]
        terms.sort(key=lambda term: (term[3], -abs(term[2])))
        masters = np.flatnonzero(np.abs(by_screw[sector]) > NEGLIGIBLE)
        yield from _equation(
            [term[:3] for term in terms]
            + [(*_screw_dof(own, int(k)), by_screw[sector, k]) for k in masters]
            + [(gap_node + int(sector), 1, -1.0)]
        )


def _is_turn(k: int) -> bool:
    """Whether one of the frames' and joints' unknowns is an angle."""
    if k < 6 * len(FRAMES):
        return k // 3 % 2 == 1
    return (k - 6 * len(FRAMES)) % 2 == 1


def _screw_dof(own: int, k: int) -> tuple[int, int]:
    """Node and direction that stand for one of the frames' and joints' unknowns."""
    if k < 6 * len(FRAMES):
        return own + k // 3, k % 3 + 1
    k -= 6 * len(FRAMES)
    return own + 2 * len(FRAMES) + k // 2, k % 2 + 1


def _equation(terms: list[tuple[int, int, float]]) -> Iterator[str]:
    yield "*EQUATION"
    yield f"{len(terms)}"
    for start in range(0, len(terms), 4):
        yield ",".join(f"{node},{way},{_number(c)}" for node, way, c in terms[start : start + 4])


def _number(value: float) -> str:
    """Write a number as CalculiX can read it: it ignores what follows the twentieth character."""
    return f"{value:.12e}"
