"""A bench for drives: the drives of the direct drive arm on their buses, driving a weightless double integrator."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

import pytest

from config import Installation, load_installation
from config.schema import Joint
from virtual_hw.bus.frames import CAN_FRAME, frame
from virtual_hw.bus.wire import Controller
from virtual_hw.drive.states import PowerState
from virtual_hw.rig import Rig

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000
INERTIA = 1.0


class Integrator:
    """Joints of 1 kg·m² with a constant load torque; brakes stop them dead."""

    n = 3
    tick_ns = 500_000

    def __init__(self, joints: Sequence[Joint]) -> None:
        self.time_ns = 0
        self.q, self.dq, self.applied = [0.5] * 3, [0.0] * 3, [0.0] * 3
        self.load_nm = [0.0] * 3
        self._joints = joints

    def advance(self, torque_nm: Sequence[float], brake: Sequence[bool]) -> None:
        h = self.tick_ns * 1e-9
        for i in range(3):
            self.applied[i] = torque_nm[i]
            self.dq[i] = 0.0 if brake[i] else self.dq[i] + h * (torque_nm[i] + self.load_nm[i]) / INERTIA
            self.q[i] += h * self.dq[i]
        self.time_ns += self.tick_ns

    def counts(self, i: int) -> int:
        encoder = self._joints[i].encoder
        return round(encoder.sign * (self.q[i] - encoder.zero_rad) / 6.283185307179586 * encoder.counts_per_turn)

    def velocity(self, i: int) -> float:
        return self.dq[i]

    def torque(self, i: int) -> float:
        return self.applied[i]

    def currents(self, i: int) -> tuple[float, float, float]:
        return 1.0, -0.25, -0.75

    def temperature(self, i: int) -> float:
        return 31.5


class Bench:
    """A host on the first bus, with node 1; time moves only by `run`, `cycle` and `power`."""

    def __init__(self, installation: Installation) -> None:
        self.arm = Integrator(installation.joint)
        self.rig = Rig(installation, self.arm, START_NS)
        self.bus, self.node = self.rig.buses[0], self.rig.nodes[0]
        self.heard: list[tuple[int, int, bytes]] = []
        self.host = Controller(64, self._hear)
        self.bus.attach(self.host)

    def _hear(self, now_ns: int, raw: bytes) -> None:
        can_id, length, data = CAN_FRAME.unpack(raw)
        self.heard.append((now_ns - START_NS, can_id, data[:length]))

    def send(self, can_id: int, data: bytes = b"") -> None:
        self.bus.send(self.host, frame(can_id, data))

    def run(self, ms: float = 1.0) -> None:
        self.rig.advance(self.rig.now_ns + round(ms * MS))

    def frames(self, can_id: int) -> list[bytes]:
        return [data for _, seen, data in self.heard if seen == can_id]

    def sdo(self, request: bytes) -> bytes:
        self.heard.clear()
        self.bus.exchange_at_once(self.host, frame(0x601, request))
        (answer,) = self.frames(0x581)
        return answer

    def read(self, index: int, subindex: int = 0) -> int:
        answer = self.sdo(struct.pack("<BHB4x", 0x40, index, subindex))
        assert answer[0] & 0xE3 == 0x43, f"{index:04X}:{subindex} answered {answer.hex()}"
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little", signed=True)

    def write(self, index: int, subindex: int, value: int, size: int) -> int:
        """Returns 0, or the abort code."""
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0")
        answer = self.sdo(struct.pack("<BHB", 0x23 | (4 - size) << 2, index, subindex) + data)
        if answer[0] == 0x80:
            assert answer[1:4] == struct.pack("<HB", index, subindex)
            return int.from_bytes(answer[4:], "little")
        assert answer[0] == 0x60
        return 0

    def nmt(self, command: int, node: int = 1) -> None:
        self.bus.exchange_at_once(self.host, frame(0x000, bytes((command, node))))

    def map_pdo(self, base: int, mappings: Sequence[int], transmission: int = 1, timer_ms: int = 0) -> None:
        """Map and enable the PDO whose communication parameter is ``base``; the node is pre-operational."""
        number = base & 0xFF
        cob_id = (0x200 if base < 0x1800 else 0x180) + 0x100 * number + 1
        assert self.write(base, 1, 1 << 31 | cob_id, 4) == 0
        assert self.write(base, 2, transmission, 1) == 0
        assert self.write(base, 5, timer_ms, 2) == 0
        assert self.write(base + 0x200, 0, 0, 1) == 0
        for k, mapping in enumerate(mappings, 1):
            assert self.write(base + 0x200, k, mapping, 4) == 0
        assert self.write(base + 0x200, 0, len(mappings), 1) == 0
        assert self.write(base, 1, cob_id, 4) == 0

    def disable_pdos(self) -> None:
        for base in (0x1400, 0x1800):
            for k in range(4):
                assert self.write(base + k, 1, self.read(base + k, 1) | 1 << 31, 4) == 0

    def commission(self, mode: int) -> None:
        """CSP or CST with the layouts that a host would map, gains, limits; then operational."""
        self.disable_pdos()
        assert self.write(0x6060, 0, mode, 1) == 0
        assert self.write(0x6072, 0, 10_000, 2) == 0
        assert self.write(0x2100, 1, 400_000, 4) == 0
        assert self.write(0x2100, 2, 28_000, 4) == 0
        rpdo = {8: [0x60400010, 0x607A0020, 0x60B20010], 9: [0x60400010, 0x60FF0020], 10: [0x60400010, 0x60710010]}
        self.map_pdo(0x1400, rpdo[mode])
        self.map_pdo(0x1800, [0x60410010, 0x60640020, 0x60770010])
        self.nmt(0x01)

    def cycle(self, rpdo: bytes = b"", ms: float = 1.0) -> bytes | None:
        """One cycle: RPDO 1, SYNC, and what TPDO 1 answered."""
        self.heard.clear()
        if rpdo:
            self.send(0x201, rpdo)
            self.run(0.2)
        self.send(0x080)
        self.run(ms - (0.2 if rpdo else 0.0))
        answers = self.frames(0x181)
        return answers[-1] if answers else None

    @property
    def status(self) -> int:
        return self.node.store.values[self.node.store.slot(0x6041)]

    @property
    def state(self) -> PowerState:
        return self.node.axis.state

    def controlword(self, *words: int) -> None:
        for word in words:
            assert self.write(0x6040, 0, word, 2) == 0
            self.run(0.5)

    def enable(self, mode: int = 10) -> None:
        """To operation enabled, by SDO controlwords; in CSP the target is where the axis is."""
        assert self.write(0x6060, 0, mode, 1) == 0
        assert self.write(0x6072, 0, 10_000, 2) == 0
        assert self.write(0x2100, 1, 400_000, 4) == 0
        assert self.write(0x2100, 2, 28_000, 4) == 0
        self.controlword(0x06, 0x07, 0x0F)
        assert self.state is PowerState.OPERATION_ENABLED
        self.run(1)  # the brake's command takes a tick to reach the arm

    def emergencies(self) -> list[int]:
        return [int.from_bytes(data[:2], "little") for data in self.frames(0x081)]


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    """Makes a bench; keyword arguments change the first joint's encoder."""
    installation = load_installation("dda")

    def make(**encoder: object) -> Bench:
        first = installation.joint[0]
        joint = first.model_copy(update={"encoder": first.encoder.model_copy(update=encoder)})
        return Bench(installation.model_copy(update={"joint": (joint, *installation.joint[1:])}))

    make.installation = installation  # type: ignore[attr-defined]
    return make


@pytest.fixture
def bench(make_bench: Callable[..., Bench]) -> Bench:
    return make_bench()
