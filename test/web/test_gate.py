"""Who is answered: names of this machine, or whoever has the token; nothing too large."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import pytest

from wrist_stiffness.web.gate import Gate

LARGEST = 1000


async def inside(scope, receive, send):
    while (message := await receive())["type"] == "http.request":
        if not message.get("more_body"):
            break
    else:
        return
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"page"})


def answer(gate, query=b"", kind="http", body=(b"",), **headers):
    """Return what the gate sends to a request."""
    names = {name.replace("_", "-").encode(): value.encode() for name, value in headers.items()}
    scope = {"type": kind, "headers": list(names.items()), "query_string": query}
    parts, sent = list(body), []

    async def receive():
        part = parts.pop(0)
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message):
        sent.append(message)

    # Playwright leaves a loop running in the thread of the tests.
    with ThreadPoolExecutor(1) as other:
        other.submit(asyncio.run, gate(scope, receive, send)).result()
    return sent


def status(*arguments, **keywords):
    sent = answer(*arguments, **keywords)
    return sent[0].get("status") if sent else None


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "localhost", "[::1]:8080"])
def test_names_of_this_machine_are_answered(host):
    assert status(Gate(inside, "", LARGEST), host=host) == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:8080", ""])
def test_another_name_for_this_machine_is_refused(host):
    assert status(Gate(inside, "", LARGEST), host=host) == 403


def test_a_page_of_another_site_opens_no_socket():
    gate = Gate(inside, "", LARGEST)
    evil = {"host": "127.0.0.1:8080", "origin": "http://evil.example"}
    assert answer(gate, kind="websocket", **evil)[0]["type"] == "websocket.close"
    own = {"host": "127.0.0.1:8080", "origin": "http://127.0.0.1:8080"}
    assert status(gate, **own) == 200


def test_beyond_this_machine_only_the_token_opens():
    gate = Gate(inside, "secret", LARGEST)
    assert status(gate, host="10.0.0.5:8080") == 403
    assert status(gate, host="10.0.0.5:8080", query=b"token=wrong") == 403
    sent = answer(gate, host="10.0.0.5:8080", query=b"token=secret")
    (_, cookie) = sent[0]["headers"][0]
    assert b"HttpOnly" in cookie
    assert status(gate, host="10.0.0.5:8080", cookie=cookie.decode().split(";")[0]) == 200
    assert status(gate, host="10.0.0.5:8080", cookie="wrist_workbench=wrong") == 403


def test_what_is_too_large_is_refused_told_or_not():
    gate = Gate(inside, "", LARGEST)
    assert status(gate, host="localhost", content_length="1001") == 413
    assert status(gate, host="localhost", content_length="many") == 413
    assert status(gate, host="localhost", body=[b"x" * 400] * 2) == 200
    assert status(gate, host="localhost", body=[b"x" * 400] * 3) is None
