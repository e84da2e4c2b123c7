"""Sessions on disk: whole at every moment, found again, never left running by a dead daemon."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from config import InputError
from service.sessions.store import Session, SessionStore, write_atomically


def made(store: SessionStore) -> Session:
    return store.create("run", {"motion": "m"}, attached=False, uid=1000)


def test_a_session_is_found_again_as_it_was_left(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    session = made(store)
    session.update(stage="playing", progress=0.5, recordings=("a.mcap",))
    again = store.open(session.id)
    assert again.record == session.record
    assert again.result() is None
    session.write_result({"x": 1.0, "missing": float("nan")})
    session.end("done")
    again = store.open(session.id)
    assert (again.record.state, again.record.progress) == ("done", 1.0)
    assert again.result() == {"x": 1.0, "missing": None}


def test_sessions_of_one_second_have_names_of_their_own(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    ids = [made(store).id for _ in range(5)]
    assert len(set(ids)) == 5
    assert [s.id for s in store.all()] == ids


def test_only_running_sessions_are_ended_as_abandoned(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    done, left = made(store), made(store)
    done.end("done")
    assert store.end_abandoned() == [left.id]
    assert store.open(done.id).record.state == "done"
    assert store.open(left.id).record.state == "interrupted"
    assert store.end_abandoned() == []


@pytest.mark.parametrize("name", ["nothing", "../secrets", "a/b"])
def test_an_unknown_session_is_named_with_those_there_are(name: str, tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    session = made(store)
    with pytest.raises(InputError, match=session.id):
        store.open(name)


def test_a_spoilt_record_is_named(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    session = made(store)
    path = session.directory / "session.json"
    path.write_text(json.dumps({"id": session.id}))
    with pytest.raises(InputError, match=r"session\.json"):
        store.open(session.id)


def test_a_failed_write_leaves_the_old_file_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    write_atomically(path, "old")

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, "new")
    assert path.read_text() == "old"


def test_no_room_for_sessions_is_said(tmp_path: Path) -> None:
    (tmp_path / "dda").write_text("a file where a directory should be")
    with pytest.raises(InputError, match="ETUDE_STATE"):
        made(SessionStore(tmp_path, "dda"))
