"""Recordings that others made: MCAP of any stock writer, CSV; and precise words for what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as PlainWriter
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.recording import RunWriter, export, read_recording
from driver.recording import ros2_definitions as ros2
from driver.recording.csv_recording import write_csv

Row = dict[str, Any]
NAMES = ["shoulder", "elbow"]


def joint_state(t: float, position: list[float], velocity: list[float], effort: list[float], names: list[str]) -> Row:
    stamp = {"sec": int(t), "nanosec": round((t - int(t)) * 1e9)}
    header = {"stamp": stamp, "frame_id": ""}
    return {"header": header, "name": names, "position": position, "velocity": velocity, "effort": effort}


def bag(
    path: Path, rows: list[Row], topic: str = "/joint_states", compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 2000,
) -> Path:  # fmt: skip
    with path.open("wb") as stream:
        writer = StockWriter(stream, chunk_size, compression)
        schema = writer.register_msgdef(ros2.JOINT_STATE, ros2.DEFINITIONS[ros2.JOINT_STATE])
        other = writer.register_msgdef(ros2.LOG, ros2.DEFINITIONS[ros2.LOG])
        log = {"level": 20, "name": "n", "msg": "m", "file": "", "function": "", "line": 0}
        for k, row in enumerate(rows):
            stamp = row["header"]["stamp"]
            writer.write_message("/rosout", other, {"stamp": stamp, **log}, k)
            writer.write_message(topic, schema, row, 10_000 + k)
        writer.finish()
    return path


def samples(count: int, seed: int = 0) -> tuple[np.ndarray, list[Row]]:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(count, 3, 2))
    rows = [joint_state(5 + 0.002 * k, *(v.tolist() for v in values[k]), NAMES) for k in range(count)]
    return values, rows


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [1, 2000, 10**7])
def test_a_bag_reads_as_arrays(tmp_path: Path, compression: CompressionType, chunk_size: int) -> None:
    values, rows = samples(150)
    recording = read_recording(bag(tmp_path / "b.mcap", rows, "/arm/state", compression, chunk_size), "/arm/state")
    assert recording.joints == tuple(NAMES)
    assert np.array_equal(recording.q, values[:, 0])
    assert recording.dq is not None
    assert recording.tau is not None
    assert np.array_equal(recording.dq, values[:, 1])
    assert np.array_equal(recording.tau, values[:, 2])
    assert recording.t == pytest.approx(0.002 * np.arange(150), abs=1e-9)
    assert recording.start_ns == 5_000_000_000
    assert recording.period == pytest.approx(0.002)
    assert (recording.q_d, recording.wrench, recording.installation, recording.gaps) == (None, None, None, ())


@pytest.mark.parametrize("chunking", [True, False])
def test_a_file_without_any_index_reads_the_same(tmp_path: Path, chunking: bool) -> None:
    values, rows = samples(40)
    indexed = bag(tmp_path / "a.mcap", rows)
    plain = tmp_path / "b.mcap"
    with indexed.open("rb") as source, plain.open("wb") as stream:
        writer = PlainWriter(
            stream, index_types=IndexType.NONE, use_chunking=chunking, use_statistics=False,
            repeat_channels=False, repeat_schemas=False, use_summary_offsets=False, chunk_size=500,
        )  # fmt: skip
        writer.start("ros2")
        ids: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.topic not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, "cdr", schema_id)
            writer.add_message(ids[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    assert np.array_equal(read_recording(plain).q, values[:, 0])


def test_absent_quantities_are_none_and_said(tmp_path: Path) -> None:
    rows = [joint_state(0.01 * k, [1.0, 2.0], [], [float("nan")] * 2, NAMES) for k in range(1, 20)]
    recording = read_recording(bag(tmp_path / "b.mcap", rows))
    assert (recording.dq, recording.tau) == (None, None)
    assert recording.notes == ("/joint_states has no velocity", "/joint_states has no effort: all of it is NaN")


def test_other_joints_on_the_same_topic_are_left_out_and_said(tmp_path: Path) -> None:
    """A gripper that publishes beside the arm, as ros2_control does."""
    values, rows = samples(60)
    grip = [joint_state(5.0005 + 0.02 * k, [0.1], [0.0], [0.0], ["finger"]) for k in range(6)]
    both = sorted(rows + grip, key=lambda r: (r["header"]["stamp"]["sec"], r["header"]["stamp"]["nanosec"]))
    recording = read_recording(bag(tmp_path / "b.mcap", both))
    assert recording.joints == tuple(NAMES)
    assert np.array_equal(recording.q, values[:, 0])
    assert recording.notes == ("6 messages on /joint_states of other joints (finger) are left out",)


def test_joint_names_of_any_length_and_order(tmp_path: Path) -> None:
    for names in (["a", "bb", "ccc"], ["joint_with_a_long_name", "ü"], ["x"]):
        rows = [joint_state(0.01 * k, [float(i) for i, _ in enumerate(names)], [], [], names) for k in range(1, 9)]
        path = tmp_path / f"{len(names)}.mcap"
        recording = read_recording(bag(path, rows))
        assert recording.joints == tuple(names)
        assert recording.q[3].tolist() == list(range(len(names)))


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda rows: rows[7].update(position=[1.0, float("nan")]), "message 8 on .*states: position of elbow is nan"),
        (lambda rows: rows[7].update(header=rows[3]["header"]), r"number 8: time 0\.006 s does not come after 0\.012"),
        (lambda rows: rows[7].update(header=rows[6]["header"]), r"number 8: time 0\.012 s does not come after 0\.012"),
        (lambda rows: rows[7].update(effort=[1.0]), "1 numbers of effort for 2 joints"),
        (lambda rows: rows[7].update(name=["elbow", "elbow"]), "a joint is named twice in elbow, elbow"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_bag_is_named_with_its_message(
    tmp_path: Path, spoil: Callable[[list[Row]], None], sentence: str
) -> None:
    _, rows = samples(20)
    spoil(rows)
    with pytest.raises(InputError, match=sentence):
        read_recording(bag(tmp_path / "b.mcap", rows))


def test_a_wrong_topic_names_the_right_ones(tmp_path: Path) -> None:
    path = bag(tmp_path / "b.mcap", samples(5)[1], "/robot/joints")
    with pytest.raises(InputError, match=r"has no topic /joint_states; name one with --topic: /robot/joints"):
        read_recording(path)
    with pytest.raises(InputError, match=r"carries rcl_interfaces/msg/Log in cdr, not sensor_msgs/msg/JointState"):
        read_recording(path, "/rosout")


def test_a_gap_in_a_bag_bounds_the_segments(tmp_path: Path) -> None:
    _, rows = samples(100)
    recording = read_recording(bag(tmp_path / "b.mcap", rows[:30] + rows[60:]))
    assert recording.segments == (slice(0, 30), slice(30, 70))
    assert "1 gap" in recording.notes[-1]


HEADER = "t,q_a,q_b,dq_a,dq_b,tau_a,tau_b,fx,fy,fz,nx,ny,nz"


def csv(path: Path, header: str = HEADER, count: int = 50, **replaced: str) -> Path:
    """``line7="…"`` puts other text at line 7."""
    width = header.count(",")
    lines = [header] + [",".join([f"{0.01 * k:.3f}"] + [f"{k + c / 10:g}" for c in range(width)]) for k in range(count)]
    for line, text in replaced.items():
        lines[int(line.removeprefix("line")) - 1] = text
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_csv_reads_as_arrays(tmp_path: Path) -> None:
    recording = read_recording(csv(tmp_path / "a.csv"))
    assert recording.joints == ("a", "b")
    assert recording.q[3].tolist() == [3.0, 3.1]
    assert recording.dq is not None
    assert recording.dq[3].tolist() == [3.2, 3.3]
    assert recording.tau is not None
    assert recording.tau[3].tolist() == [3.4, 3.5]
    assert recording.wrench is not None
    assert recording.wrench[3].tolist() == [3.6, 3.7, 3.8, 3.9, 4.0, 4.1]
    short = read_recording(csv(tmp_path / "b.csv", "t,q_a,tau_a"))
    assert (short.dq, short.wrench) == (None, None)
    assert short.notes == ("no dq columns",)
    bom = csv(tmp_path / "c.csv")
    bom.write_bytes(b"\xef\xbb\xbf" + bom.read_bytes().replace(b"\n", b"\r\n"))
    assert np.array_equal(read_recording(bom).q, recording.q)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"header": "t,q_a,q_b,dq_a,tau_a,tau_b"}, r"line 1: the column 'dq_b' is missing; give dq_ for every joint"),
        ({"header": "t,q_a,tau_a,tau_c"}, r"line 1: 'tau_c' is there without 'q_c'"),
        ({"header": "t,q_a,fx,fy,fz,nx,ny"}, r"line 1: the column 'nz' is missing; give all six"),
        ({"header": "time,q_a"}, r"line 1, column 1: is 'time', not 't'"),
        ({"header": "t;q_a;tau_a"}, r"line 1: columns are parted by semicolons; write commas"),
        ({"header": "t\tq_a\ttau_a"}, r"line 1: columns are parted by tabs; write commas"),
        ({"header": "# recorded in May\nt,q_a"}, r"line 1: is a comment; leave it out"),
        ({"line7": "0.050,1,2," + 100 * "x" + ",4,5,6,7,8,9,10,11,12"}, r"\(dq_a\): 'x{40}…' is not"),
        ({"header": "t,q_a,q_a"}, r"line 1, column 3: 'q_a' is there twice"),
        ({"header": "t,q_a,speed_a"}, r"line 1, column 3: 'speed_a' is no column of a recording"),
        ({"header": "t,tau_a"}, "there is no column q_<joint>"),
        ({"line7": "0.050,1,2,3,4,nan,6,7,8,9,10,11,12"}, r"line 7, column 6 \(tau_a\): 'nan' is not a number"),
        ({"line7": "0.050,1,2,3,4,,6,7,8,9,10,11,12"}, r"line 7, column 6 \(tau_a\): '' is not a number"),
        ({"line7": "0.050,1,2,3,inf,5,6,7,8,9,10,11,12"}, r"line 7, column 5 \(dq_b\): 'inf' is not a number"),
        ({"line7": "0.050,1,2,x3,4,5,6,7,8,9,10,11,12"}, r"line 7, column 4 \(dq_a\): 'x3' is not a number"),
        ({"line7": "0.050,1,2"}, r"line 7: has 3 fields, the header 13; the line may be cut off"),
        ({"line7": "0.03,1,2,3,4,5,6,7,8,9,10,11,12"}, r"line 7, column 1 \(t\): time 0\.03 does not come after 0\.04"),
        ({"line7": "\n\n0.04,1,2,3,4,5,6,7,8,9,10,11,12"}, r"line 9, column 1 \(t\): time 0\.04 does not come after"),
        ({"line51": "7.5,1,2,3,4,5,6,7,8,9,10,11,12"}, r"line 51, column 1 \(t\): a gap of 7\.02 s where .* 0\.01 s"),
        ({"count": 0}, "has no samples behind its header"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_csv_is_named_with_line_and_column(
    tmp_path: Path, change: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        read_recording(csv(tmp_path / "a.csv", **change))


def test_files_that_are_no_recordings_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01" * 20)
    (tmp_path / "bag.db3").write_bytes(b"SQLite format 3\0")
    (tmp_path / "bag.mcap.zstd").write_bytes(b"\x28\xb5\x2f\xfd rest")
    for name, sentence in (
        ("nothing.csv", "there is no such file"),
        ("empty.csv", "is empty"),
        ("binary.csv", "is not text"),
        ("bag.db3", "is a rosbag2 database, not MCAP; convert it"),
        ("bag.mcap.zstd", "is compressed as a whole; unpack it first"),
        (".", "is a directory"),
    ):
        with pytest.raises(InputError, match=sentence):
            read_recording(tmp_path / name)


def test_export_and_import_keep_every_digit(
    tmp_path: Path, dda: Installation, make_cycles: Callable[..., list[Cycle]]
) -> None:
    cycles = make_cycles(dda, 200, lost_share=0.002)
    writer = RunWriter(tmp_path / "run.mcap", dda, {})
    for cycle in cycles:
        writer.write(cycle)
    writer.finish()
    original = read_recording(tmp_path / "run.mcap")
    left_out = export(tmp_path / "run.mcap", tmp_path / "run.csv")
    recording = read_recording(tmp_path / "run.csv")
    rows = np.isin(original.t, recording.t)
    assert left_out == (200 - len(recording.t), ())
    assert 0 < left_out.samples < 20
    assert recording.joints == original.joints
    for name in ("q", "dq", "tau"):
        assert np.array_equal(getattr(recording, name), getattr(original, name)[rows]), name
    assert recording.wrench is not None
    assert recording.wrench.shape == (len(recording.t), 6)
    with pytest.raises(InputError, match="is already there"):
        export(tmp_path / "run.mcap", tmp_path / "run.csv")


def test_export_keeps_the_joints_of_a_run_whose_wrench_sensor_was_dead(
    tmp_path: Path, dda: Installation, make_cycles: Callable[..., list[Cycle]]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", dda, {})
    for cycle in make_cycles(dda, 200):
        writer.write(cycle)
    writer.finish()
    original = read_recording(tmp_path / "run.mcap")
    assert original.wrench is not None
    dead = replace(original, wrench=np.full_like(original.wrench, np.nan))
    assert write_csv(dead, tmp_path / "dead.csv") == (0, ("wrench",))
    recording = read_recording(tmp_path / "dead.csv")
    assert np.array_equal(recording.q, original.q)
    assert recording.wrench is None


def test_a_real_recording_through_csv(tmp_path: Path) -> None:
    """Half a second of the Panda, jittered times and all."""
    folder = Path(__file__).parents[2] / ".." / "shared" / "data" / "franka_panda"
    if not folder.exists():
        pytest.skip("../shared/data/franka_panda is not here")
    t = np.loadtxt(folder / "exciting_traj_time.txt")[:500]
    columns = [np.loadtxt(folder / f"exciting_traj_{n}.txt").reshape(-1, 7)[:500] for n in ("positions", "torques")]
    header = ",".join(["t", *(f"q_panda_joint{i}" for i in range(1, 8)), *(f"tau_panda_joint{i}" for i in range(1, 8))])
    np.savetxt(tmp_path / "panda.csv", np.column_stack([t, *columns]), delimiter=",", header=header, comments="")
    recording = read_recording(tmp_path / "panda.csv")
    assert recording.q.shape == (500, 7)
    assert recording.dq is None
    assert recording.tau is not None
    assert recording.tau == pytest.approx(columns[1])


def test_a_foreign_bag_brings_its_wrench(tmp_path: Path) -> None:
    _, rows = samples(30)
    values = np.random.default_rng(2).normal(size=(20, 6))
    path = tmp_path / "wrench.mcap"
    with path.open("wb") as stream:
        writer = StockWriter(stream)
        states = writer.register_msgdef(ros2.JOINT_STATE, ros2.DEFINITIONS[ros2.JOINT_STATE])
        wrenches = writer.register_msgdef(ros2.WRENCH_STAMPED, ros2.DEFINITIONS[ros2.WRENCH_STAMPED])
        for k, row in enumerate(rows):
            writer.write_message("/joint_states", states, row, 1000 + k)
        for k, (fx, fy, fz, nx, ny, nz) in enumerate(values.tolist()):
            header = {"stamp": {"sec": 5, "nanosec": 1_000_000 + 3_000_000 * k}, "frame_id": "wrist_sensor"}
            force, torque = {"x": fx, "y": fy, "z": fz}, {"x": nx, "y": ny, "z": nz}
            message = {"header": header, "wrench": {"force": force, "torque": torque}}
            writer.write_message("/ft/raw", wrenches, message, 2000 + k)
        writer.finish()
    recording = read_recording(path)
    assert recording.wrench is not None
    assert recording.wrench_t is not None
    np.testing.assert_array_equal(recording.wrench, values)
    np.testing.assert_allclose(recording.wrench_t, 0.001 + 0.003 * np.arange(20), atol=1e-9)
    assert recording.wrench_frame == "wrist_sensor"
