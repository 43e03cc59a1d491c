"""The server of a page that is watched, asked by a real client."""

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from hj_cosim.watching import server as server_module
from hj_cosim.watching.server import LOOPBACK, WatchServer


@pytest.fixture
def server() -> Iterator[WatchServer]:
    with WatchServer("<p>page</p>", port=0) as server:
        yield server


def ask(server: WatchServer, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(LOOPBACK, server.port, timeout=10)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def test_the_page_is_there_for_who_has_the_token(server):
    answer = ask(server, f"/?token={server.token}")
    assert (answer.status, answer.read()) == (200, b"<p>page</p>")
    assert answer.headers["Cache-Control"] == "no-store"
    assert answer.headers["Referrer-Policy"] == "no-referrer"
    assert server.address == f"http://127.0.0.1:{server.port}/?token={server.token}"
    assert len(server.token) >= 24


@pytest.mark.parametrize("query", ["", "?token=", "?token=guess", "?token=%C3%A4", "?other=1"])
def test_without_the_token_nothing_is_answered(server, query):
    for path in ("/", "/events", "/elsewhere"):
        answer = ask(server, f"{path}{query}")
        assert answer.status == 403
        assert b"page" not in answer.read()


def test_a_name_from_elsewhere_that_points_here_is_refused(server):
    assert ask(server, f"/?token={server.token}", Host=f"evil.example:{server.port}").status == 403
    assert ask(server, f"/?token={server.token}", Host=f"localhost:{server.port}").status == 200


def test_there_is_nothing_else(server):
    assert ask(server, f"/../etc/passwd?token={server.token}").status == 404


def test_it_listens_on_the_loopback_alone(server):
    assert server._server.server_address[0] == "127.0.0.1"


def test_events_come_from_the_beginning_in_order_and_those_that_were_missed_again(server):
    server.publish("stretch", "one")
    server.publish("stretch", "two")
    answer = ask(server, f"/events?token={server.token}")
    assert answer.headers["Content-Type"] == "text/event-stream"
    assert [answer.readline() for _ in range(8)] == [
        *(b"id: 0\n", b"event: stretch\n", b"data: one\n", b"\n"),
        *(b"id: 1\n", b"event: stretch\n", b"data: two\n", b"\n"),
    ]
    server.publish("end", "three")
    assert [answer.readline() for _ in range(3)] == [b"id: 2\n", b"event: end\n", b"data: three\n"]
    again = ask(server, f"/events?token={server.token}", **{"Last-Event-ID": "1"})
    assert again.readline() == b"id: 2\n"


def test_it_waits_for_the_page_and_not_for_ever(server):
    began = time.monotonic()
    assert not server.wait_for_page(0.05)
    assert time.monotonic() - began < 5.0
    answer = ask(server, f"/events?token={server.token}")
    assert server.wait_for_page(10.0)
    answer.close()


def test_a_page_that_is_closed_is_noticed_and_who_publishes_goes_on(server, monkeypatch):
    monkeypatch.setattr(server_module, "HEARTBEAT", 0.01)
    answer = ask(server, f"/events?token={server.token}")
    assert server.wait_for_page(10.0)
    answer.close()
    until = time.monotonic() + 10.0
    while server._looking:
        server.publish("stretch", "x" * 10_000)
        assert time.monotonic() < until, "the closed page was never noticed"
        time.sleep(0.01)


def test_closing_lets_the_last_event_arrive_and_then_ends():
    server = WatchServer("", port=0)
    answer = ask(server, f"/events?token={server.token}")
    assert server.wait_for_page(10.0)
    server.publish("end", json.dumps("over"))
    server.close()
    assert b'data: "over"\n' in answer.read()  # read to its end: the server let go
    with pytest.raises(OSError, match=r"refused|reset"):
        ask(server, "/")


def test_where_the_port_is_taken_it_takes_another():
    with socket.create_server((LOOPBACK, 0)) as other:
        taken = other.getsockname()[1]
        with WatchServer("", port=taken) as server:
            assert server.port != taken
            assert ask(server, f"/?token={server.token}").status == 200


def test_many_may_look_on_and_nobody_slows_who_publishes(server):
    answers = [ask(server, f"/events?token={server.token}") for _ in range(4)]
    idle = ask(server, f"/events?token={server.token}")  # reads nothing
    began = time.monotonic()
    for _ in range(200):
        server.publish("stretch", "x" * 20_000)
    assert time.monotonic() - began < 2.0
    threads = [threading.Thread(target=answer.read, args=(100_000,)) for answer in answers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
        assert not thread.is_alive()
    idle.close()
