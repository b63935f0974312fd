"""Changes of a node that can be prepared, made and undone: so those of all nodes are one.

A node's `~/ACTION/prepare` does all that can fail, `~/commit` makes the change that was prepared
or, with `false`, drops or undoes it.  `all_or_none` asks all nodes of a namespace in two steps.
"""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from wrist_stiffness.errors import InputError

PREPARE, COMMIT = "prepare", "commit"

LONGEST_ANSWER_S = 3.0
"""Beyond the time that a preparation itself may take, so long a node may need to answer."""


@dataclass(frozen=True)
class Change:
    """What a node is ready to do."""

    said: str  # what to tell who asked for it
    make: Callable[[], Callable[[], None]]  # makes the change; returns what undoes it


class Turn:
    """Awaited, gives the executor's other callbacks a turn."""

    def __await__(self) -> Generator[None, None, None]:
        """Come back once."""
        yield


async def until(condition: Callable[[], bool], longest_s: float) -> bool:
    """Wait for a condition while other callbacks run; False if it took too long [s]."""
    end = time.monotonic() + longest_s
    while not condition():
        if time.monotonic() > end:
            return False
        await Turn()
    return True


async def all_or_none(
    node: Node, action: str, service_type: type, request: Any, longest_s: float
) -> str:
    """Make a change in all nodes of a namespace, or in none.

    `node`: asks; others of its namespace that offer the change are asked like itself; `action`:
    name of the change; `service_type`, `request`: of `~/ACTION/prepare`; `longest_s`: how long a
    preparation may take [s].  Gives what the nodes said.  Raises `InputError` with what each node
    that cannot says; nothing has changed then.
    """
    ending = f"/{action}/{PREPARE}"
    base = node.get_namespace().rstrip("/") + "/"
    paths = [name for name, _ in node.get_service_names_and_types() if name.endswith(ending)]
    paths = [path.removesuffix(ending) for path in paths]
    nodes = sorted(path for path in paths if path.rpartition("/")[0] + "/" == base)

    async def ask(
        some: Iterable[str], kind: type, suffix: str, asked: Any, limit_s: float
    ) -> dict[str, str]:
        """Ask nodes at once; return what is wrong by node, and keep what is said."""
        clients = {path: node.create_client(kind, f"{path}/{suffix}") for path in some}
        try:
            ready = [client.service_is_ready for client in clients.values()]
            await until(lambda: all(each() for each in ready), LONGEST_ANSWER_S)
            answers = {path: each.call_async(asked) for path, each in clients.items()}
            await until(lambda: all(each.done() for each in answers.values()), limit_s)
        finally:
            for client in clients.values():
                node.destroy_client(client)
        wrong = {}
        for path, answer in answers.items():
            if not answer.done():
                wrong[path] = f"no answer within {limit_s:g} s"
            elif not answer.result().success:
                wrong[path] = answer.result().message
            else:
                said[path] = answer.result().message
        return wrong

    said: dict[str, str] = {}
    prepare, limit_s = f"{action}/{PREPARE}", longest_s + LONGEST_ANSWER_S
    wrong = await ask(nodes, service_type, prepare, request, limit_s)
    if not wrong:
        wrong = await ask(nodes, SetBool, COMMIT, SetBool.Request(data=True), LONGEST_ANSWER_S)
    if wrong:
        # The others have nothing to undo but an earlier change, which stays.
        await ask(said, SetBool, COMMIT, SetBool.Request(data=False), LONGEST_ANSWER_S)
        raise InputError(f"nothing has changed: {_lines(wrong, base)}")
    return _lines(said, base)


def _lines(texts: dict[str, str], base: str) -> str:
    return "; ".join(f"{path.removeprefix(base)}: {text}" for path, text in texts.items())


Prepare = Callable[[Any], Change | Awaitable[Change]]
"""Takes a service's request; raises WristError where the change cannot be."""
