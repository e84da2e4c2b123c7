"""The listening socket of a bus: who may have it."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from config import InputError
from virtual_hw.bus.local import LocalPort
from virtual_hw.bus.wire import Bus


def port(path: Path) -> LocalPort:
    return LocalPort(path, Bus("can0", 1_000_000, 0))


def test_one_stand_in_a_bus(tmp_path: Path) -> None:
    first = port(tmp_path / "can0")
    with pytest.raises(InputError, match="another stand-in arm runs on this bus"):
        port(tmp_path / "can0")
    first.close()
    assert list(tmp_path.iterdir()) == []


def test_the_socket_of_a_dead_stand_in_is_no_obstacle(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as dead:
        dead.bind(str(tmp_path / "can0"))
    taken = port(tmp_path / "can0")
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as host:
        host.connect(str(tmp_path / "can0"))  # Refused while nobody listens.
    taken.close()
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_not_removed(tmp_path: Path) -> None:
    (tmp_path / "can0").write_text("mine")
    with pytest.raises(InputError, match="taken by a file that is no socket"):
        port(tmp_path / "can0")
    assert (tmp_path / "can0").read_text() == "mine"


def test_a_path_too_long_for_a_socket_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot listen"):
        port(tmp_path / ("x" * 120))


def test_a_port_that_another_has_taken_over_is_left_to_it(tmp_path: Path) -> None:
    first = port(tmp_path / "can0")
    (tmp_path / "can0").unlink()
    second = port(tmp_path / "can0")
    first.close()
    assert (tmp_path / "can0").exists()
    second.close()


def test_members_of_the_group_may_connect(tmp_path: Path) -> None:
    opened = port(tmp_path / "can0")
    assert (tmp_path / "can0").stat().st_mode & 0o777 == 0o660
    opened.close()
