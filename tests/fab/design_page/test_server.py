"""The page's server: who may ask, what no path reaches, one run at a time with its lines, an end without leftovers."""

from __future__ import annotations

import http.client
import json
import socket
import sys
import threading
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from cad.errors import FileError, ParameterError
from fab.design_page import __main__ as command
from fab.design_page.jobs import Jobs
from fab.design_page.server import TOKEN_HEADER, DesignServer

LABEL = "D130_T8"
PRINTS = "import sys; print('   0.1 s core', flush=True); print('made', flush=True)"
WAITS = "import sys; print('waits', flush=True); sys.stdin.read() or __import__('signal').pause()"


def stand_in(script: str):
    return lambda words, printer, is_whole, exports: [[sys.executable, "-c", script]]


@contextmanager
def served(exports: Path, script: str = PRINTS):
    jobs = Jobs(exports, stand_in(script))
    with DesignServer(exports, jobs, 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield server
        finally:
            jobs.close()
            server.shutdown()


def ask(server: DesignServer, path: str, body: dict | None = None, **headers: str):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    data = None if body is None else json.dumps(body)
    connection.request("GET" if body is None else "POST", path, data, headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content, answer.headers


@pytest.fixture(scope="module")
def exports(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("exports")
    (folder / LABEL / "sheet").mkdir(parents=True)
    (folder / LABEL / "index.html").write_text("<p>folder")
    (folder / LABEL / "sheet" / "build_sheet.html").write_text("<p>sheet")
    (folder / LABEL / ".hidden").write_text("no")
    (folder / "secret.txt").write_text("no")
    (folder / LABEL / "way_out").symlink_to(folder / "secret.txt")
    return folder


@pytest.fixture(scope="module")
def server(exports):
    with served(exports) as server:
        yield server


def test_a_page_of_another_name_and_a_button_without_the_token_are_refused(server):
    for host in ("evil.example", "evil.example:8010", "127.0.0.1.evil.example", ""):
        assert ask(server, "/answer.json?D=130&T=8", Host=host)[0] == 403
    for host in ("127.0.0.1", "localhost:1", "[::1]:8010"):
        assert ask(server, "/answer.json?D=130&T=8", Host=host)[0] == 200
    good = {TOKEN_HEADER: server.token}
    assert ask(server, "/make", {"D": "130", "T": "8"})[0] == 403
    assert ask(server, "/make", {"D": "130", "T": "8"}, **{TOKEN_HEADER: "guess"})[0] == 403
    assert ask(server, "/make", {"D": "130", "T": "8"}, Origin="http://evil.example", **good)[0] == 403
    assert server.jobs.seen(-1)["number"] == 0  # nothing has been started


def test_an_empty_field_is_no_size(server):
    status, content, _ = ask(server, "/answer.json?D=&T=10")
    assert status == 200 and "D= is not a number" in json.loads(content)["refusal"]


def raw(server: DesignServer, target: str) -> bytes:
    """The answer to a request whose address no client would send."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=60) as connection:
        connection.sendall(f"GET {target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        return b"".join(iter(partial(connection.recv, 4096), b""))


@pytest.mark.parametrize("target", ["http://[", "/answer.json?" + "&".join(f"a{k}=1" for k in range(20))])
def test_an_address_that_cannot_be_read_is_refused_in_one_line(server, capsys, target):
    answer = raw(server, target)
    assert answer.startswith(b"HTTP/1.1 400 ") and b"This address cannot be read: " in answer
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("body", [{"D": 163.7, "T": 9.35}, {"D": "130", "T": "8", "whole": "yes"}, {"D": None}])
def test_knobs_of_another_kind_are_refused_and_no_other_size_is_made(server, body):
    status, content, _ = ask(server, "/make", body, **{TOKEN_HEADER: server.token})
    assert status == 400 and b"Knobs are texts" in content and not server.jobs.seen(-1)["running"]


def raising(error: Exception):
    def stand_in(*_: object) -> None:
        raise error

    return stand_in


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (FileError("cad/materials.csv: line 3: no density"), "cad/materials.csv: line 3: no density"),
        (KeyError("bowl"), "An error of the program, please report it: KeyError: 'bowl' (test_server.py, line "),
    ],
)
def test_an_error_while_answering_is_a_line_on_the_page_and_in_the_terminal(server, monkeypatch, capsys, error, said):
    monkeypatch.setattr("fab.design_page.server.answer", raising(error))
    monkeypatch.setattr(server.jobs, "stop", raising(error))
    button = {TOKEN_HEADER: server.token}
    for status, content, _ in (ask(server, "/answer.json?D=130&T=8"), ask(server, "/stop", {}, **button)):
        assert status == 500 and content.decode().startswith(said)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and all(line.startswith("design page: ") for line in lines)


def test_every_answer_forbids_frames_and_other_networks(server):
    for path in ("/", "/page.js", "/viewer.js", "/region.json", f"/exports/{LABEL}/index.html", "/nothing"):
        _, _, headers = ask(server, path)
        policy = headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in policy and "http" not in policy and headers["X-Frame-Options"] == "DENY"
    assert "sandbox" in ask(server, f"/exports/{LABEL}/index.html")[2]["Content-Security-Policy"]
    assert server.token.encode() in ask(server, "/")[1]


@pytest.mark.parametrize(
    "path",
    [
        "/exports/secret.txt", "/exports/../secret.txt", f"/exports/{LABEL}/../../secret.txt", "/exports/D130_T8",
        f"/exports/{LABEL}/%2e%2e/secret.txt", f"/exports/{LABEL}/.hidden", f"/exports/{LABEL}/way_out",
        f"/exports/{LABEL}/sheet", "/exports/D1_T1/index.html", "/exports/..%2f/secret.txt", f"/exports/{LABEL}/a%00b",
    ],
)  # fmt: skip
def test_no_path_leaves_the_folder_of_an_export(server, path):
    status, content, _ = ask(server, path)
    assert status == 404 and content != b"no"


def test_a_folder_that_index_html_links_is_named_with_its_place(server, exports):
    status, content, _ = ask(server, f"/exports/{LABEL}/sheet/")
    assert status == 404 and content.decode().endswith(f"its files are in {exports / LABEL / 'sheet'}")
    assert ask(server, "/exports/../")[1] == ask(server, f"/exports/{LABEL}/../")[1] == b"No such file."


def test_files_of_an_export_are_served_as_they_are(server):
    assert ask(server, f"/exports/{LABEL}/index.html")[:2] == (200, b"<p>folder")
    assert ask(server, f"/exports/{LABEL}/sheet/build_sheet.html")[:2] == (200, b"<p>sheet")


@pytest.mark.parametrize("body", ["[]", "{", "x" * 5000, "[" * 3000])
def test_what_is_no_request_starts_nothing(server, body):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    connection.request("POST", "/make", body, {TOKEN_HEADER: server.token})
    assert connection.getresponse().status in (400, 413)
    assert server.jobs.seen(-1)["running"] is False


@pytest.mark.parametrize("length", ["1" * 5000, "-1", "2 2", "\u00b2"])
def test_a_length_that_no_browser_sends_is_refused_and_is_no_error_of_the_program(server, capsys, length):
    headers = {TOKEN_HEADER: server.token, "Content-Length": length.encode("latin-1")}
    assert ask(server, "/stop", {}, **headers)[0] == 413 and capsys.readouterr().err == ""


def test_half_a_character_in_a_knob_is_refused_as_a_value(server, capsys):
    status, content, _ = ask(server, "/make", {"D": "\ud800", "T": "8"}, **{TOKEN_HEADER: server.token})
    assert status == 400 and content.startswith(b"D=\\ud800 is not a number") and capsys.readouterr().err == ""


def test_a_size_that_cannot_be_made_is_refused_in_the_words_of_the_command(server):
    status, content, _ = ask(server, "/make", {"D": "20", "T": "8"}, **{TOKEN_HEADER: server.token})
    assert status == 400 and b"D=20 outside" in content
    assert ask(server, "/preview.glb?D=20&T=8")[0] == 400


def follow(server: DesignServer, until):
    """The first state of the run that is as wanted; each question is answered when something has changed."""
    seen = -1
    while True:
        state = json.loads(ask(server, f"/job.json?seen={max(seen, 0)}" if seen >= 0 else "/job.json")[1])
        if until(state):
            return state
        seen = state["number"]


def test_a_run_shows_its_lines_and_its_end(exports):
    with served(exports) as server:
        good = {TOKEN_HEADER: server.token}
        status, content, _ = ask(server, "/make", {"D": "130", "T": "8", "material": "Smooth-Sil 950"}, **good)
        assert status == 200 and json.loads(content) == {"label": LABEL}
        state = follow(server, lambda s: s["number"] and not s["running"])
        assert state["lines"] == ["   0.1 s core", "made"] and state["status"] == 0 and state["label"] == LABEL


def test_one_run_at_a_time_and_stop_ends_it(exports):
    with served(exports, WAITS) as server:
        good = {TOKEN_HEADER: server.token}
        assert ask(server, "/make", {}, **good)[0] == 200
        follow(server, lambda s: s["lines"] == ["waits"])
        assert ask(server, "/make", {}, **good)[0] == 409
        assert ask(server, "/stop", {}, **good)[0] == 200
        state = follow(server, lambda s: not s["running"])
        assert state["status"] != 0 and state["stopped"]


def test_closing_the_page_ends_its_run(exports):
    with served(exports, WAITS) as server:
        assert ask(server, "/make", {}, **{TOKEN_HEADER: server.token})[0] == 200
        follow(server, lambda s: s["lines"] == ["waits"])
        process = server.jobs._process
    assert process.poll() is not None


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["port=http"], "is no port"),
        (["port=" + 5000 * "1"], "is no port"),
        (["open=maybe"], "neither yes nor no"),
        (["D=130"], "is not an option"),
    ],
)
def test_bad_options_get_one_line_and_status_2(words, expected, tmp_path, capsys):
    assert command.main([*words, f"exports={tmp_path}"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and expected in err


def test_a_port_that_is_taken_is_refused_if_it_was_named(exports, server):
    with pytest.raises(ParameterError, match=f"port={server.server_port}"):
        DesignServer(exports, Jobs(exports), server.server_port)
