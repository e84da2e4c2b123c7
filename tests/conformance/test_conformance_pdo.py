"""PDOs: when they act, when they come, what is refused; emergencies on the way."""

from __future__ import annotations

from typing import Any

import pytest

from config import InputError
from driver.bus.frames import pack
from driver.cia402 import objects
from driver.cia402.nodes import Nmt
from driver.cia402.states import Control, State, state_of

INVALID = 0x8000_0000


SELDOM = 240
"""SYNCs from one telling of the motor's temperature to the next."""


def tpdo_ids(bench: Any) -> list[int]:
    return [pdo.cob_id for pdo in bench.maps if not pdo.receive]


def test_each_sync_brings_each_tpdo_once_and_the_seldom_one_at_its_own(bench: Any) -> None:
    heard = bench.run(SELDOM, Control.DISABLE_VOLTAGE)
    for pdo in bench.maps:
        if not pdo.receive:
            data = [frame.data for frame in heard if frame.can_id == pdo.cob_id]
            assert [len(d) for d in data] == [pdo.length] * (SELDOM // pdo.transmission)


def test_without_sync_nothing_comes(bench: Any) -> None:
    heard = bench.run(10, sync=False)
    assert not {frame.can_id for frame in heard} & set(tpdo_ids(bench))


def test_in_pre_operational_pdos_rest(bench: Any) -> None:
    bench.nmt(Nmt.PRE_OPERATIONAL)
    bench.run(1)
    heard = bench.run(10, Control.SHUTDOWN)
    assert not {frame.can_id for frame in heard} & set(tpdo_ids(bench))
    assert bench.state() is State.SWITCH_ON_DISABLED
    bench.nmt(Nmt.START)
    assert bench.settle(Control.SHUTDOWN) is State.READY


def test_a_synchronous_rpdo_acts_at_the_sync(bench: Any) -> None:
    bench.run(1, Control.SHUTDOWN, sync=False)
    bench.run(5, sync=False)
    assert bench.state() is State.SWITCH_ON_DISABLED
    bench.run(1)
    bench.run(2, sync=False)
    assert bench.state() is State.READY


def test_what_a_tpdo_tells_is_what_sdo_tells(bench: Any) -> None:
    heard = bench.run(5, Control.SHUTDOWN)
    assert state_of(bench.statusword(heard)) is State.READY is bench.state()


def test_an_rpdo_too_short_is_not_processed_and_told(bench: Any) -> None:
    rpdo = next(pdo for pdo in bench.maps if pdo.receive)
    heard = bench.run(3, extra=pack(rpdo.cob_id, b"\x06"))
    assert 0x8210 in bench.emergencies(heard)
    assert bench.state() is State.SWITCH_ON_DISABLED


def test_commands_that_stay_away_are_a_fault(bench: Any) -> None:
    bench.run(5, Control.SHUTDOWN)
    heard = bench.run(100)
    assert 0x8250 in bench.emergencies(heard)
    assert bench.sdo.read(objects.ERROR_REGISTER) & 0x11
    assert bench.sdo.read(objects.ERROR_CODE) == 0x8250
    assert bench.sdo.read(0x1003, 1) & 0xFFFF == 0x8250
    bench.run(5, Control.DISABLE_VOLTAGE)
    heard = bench.run(5, Control.FAULT_RESET)
    assert 0x0000 in bench.emergencies(heard)
    assert bench.sdo.read(objects.ERROR_REGISTER) == 0


def test_an_sdo_write_to_a_mapped_object_lasts_until_the_next_rpdo(bench: Any) -> None:
    bench.run(2, Control.DISABLE_VOLTAGE)
    bench.sdo.write(objects.CONTROLWORD, 0, Control.SHUTDOWN)
    assert bench.settle(Control.DISABLE_VOLTAGE) is State.SWITCH_ON_DISABLED
    assert bench.sdo.read(objects.CONTROLWORD) == Control.DISABLE_VOLTAGE


def test_unused_pdos_are_deaf(bench: Any) -> None:
    used = {pdo.cob_id for pdo in bench.maps if pdo.receive}
    strange = b"".join(pack(base + bench.node_id, b"\x06\x00") for base in (0x200, 0x300, 0x400, 0x500)
                       if base + bench.node_id not in used)  # fmt: skip
    assert strange
    heard = bench.run(5, extra=strange)
    assert bench.emergencies(heard) == []
    assert bench.state() is State.SWITCH_ON_DISABLED


def rpdo1(bench: Any) -> Any:
    bench.nmt(Nmt.PRE_OPERATIONAL)
    bench.run(1)
    return next(pdo for pdo in bench.maps if pdo.receive)


def test_a_live_pdo_is_not_remapped(bench: Any) -> None:
    pdo = rpdo1(bench)
    with pytest.raises(InputError, match=r"abort 0[68]"):
        bench.sdo.write(pdo.mapping, 1, pdo.entries[0])


def test_a_pdo_is_at_most_8_bytes(bench: Any) -> None:
    pdo = rpdo1(bench)
    bench.sdo.write(pdo.communication, 1, INVALID | pdo.cob_id)
    bench.sdo.write(pdo.mapping, 0, 0)
    with pytest.raises(InputError, match=r"exceed the length of the PDO \(abort 06040042\)"):
        for subindex in (1, 2, 3):
            bench.sdo.write(pdo.mapping, subindex, 0x607A0020)
        bench.sdo.write(pdo.mapping, 0, 3)


@pytest.mark.parametrize(
    ("entry", "abort"),
    [(0x10000020, "06040041"), (0x60410010, "06040041"), (0x5FFF0010, "06020000"), (0x60400510, "06090011")],
    ids=["not mappable", "read-only", "no object", "no sub-index"],
)
def test_what_cannot_be_mapped_is_refused(bench: Any, entry: int, abort: str) -> None:
    pdo = rpdo1(bench)
    bench.sdo.write(pdo.communication, 1, INVALID | pdo.cob_id)
    bench.sdo.write(pdo.mapping, 0, 0)
    with pytest.raises(InputError, match=f"abort ({abort}|06040041)"):
        bench.sdo.write(pdo.mapping, 1, entry)
        bench.sdo.write(pdo.mapping, 0, 1)
