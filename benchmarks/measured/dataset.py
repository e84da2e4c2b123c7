"""What every adaptor of a measured recording returns: an arm's URDF, and its motions as trajectories."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, load_rigid_body

Array = NDArray[np.float64]

DATA = Path(__file__).parents[2].parent / "shared" / "data"
"""Recordings that others made lie beside the repository, or are absent."""


def data_folder(name: str) -> Path:
    """The folder of a data set. Raises InputError where it is absent."""
    path = DATA / name
    if not path.is_dir():
        raise InputError(f"../shared/data/{name}", "is not there", "put the published recording beside the repository")
    return path


def is_here(name: str) -> bool:
    return (DATA / name).is_dir()


@dataclass(frozen=True)
class MeasuredArm:
    """One rig: the text of its URDF and its recordings, SI units, joints as in the URDF.

    ``recordings`` by name, in the order of recording; those in ``held_out`` are for judging.
    """

    name: str
    urdf: str
    recordings: dict[str, Trajectory]
    held_out: tuple[str, ...] = ()
    motors: dict[str, Array] = field(default_factory=dict)
    """(samples, n) N·m at the joints by the motors' currents, of recordings whose torques are those of sensors."""
    motor_angles: dict[str, Array] = field(default_factory=dict)
    """(samples, n) rad at the joints by the motors' encoders, of recordings whose angles are those of encoders behind
    the gears; NaN of joints without."""

    @property
    def body(self) -> RigidBody:
        return load_rigid_body(self.urdf)

    @property
    def training(self) -> list[Trajectory]:
        """The recordings to learn from."""
        return [t for name, t in self.recordings.items() if name not in self.held_out]

    @property
    def judging(self) -> list[Trajectory]:
        """The recordings that are held out."""
        return [self.recordings[name] for name in self.held_out]


def write_files(arm: MeasuredArm, directory: Path) -> Iterator[Path]:
    """Writes ``<arm>.urdf`` and a CSV a recording, with the header that `etude` reads; yields what it wrote."""
    directory.mkdir(parents=True, exist_ok=True)
    urdf = directory / f"{arm.name}.urdf"
    urdf.write_text(arm.urdf)
    yield urdf
    joints = arm.body.joints
    for name, trajectory in arm.recordings.items():
        quantities = {"q": trajectory.q, "dq": trajectory.dq, "tau": trajectory.tau, "tau_motor": arm.motors.get(name)}
        present = {quantity: values for quantity, values in quantities.items() if values is not None}
        header = ["t", *(f"{quantity}_{joint}" for quantity in present for joint in joints)]
        table = np.column_stack([trajectory.t, *present.values()])
        of_some = {"q_motor": arm.motor_angles.get(name), "temperature": trajectory.temperature}
        for quantity, values in of_some.items():
            if values is not None:
                told = np.flatnonzero(np.isfinite(values).any(axis=0))
                header += [f"{quantity}_{joints[k]}" for k in told]
                table = np.column_stack([table, values[:, told]])
        path = directory / f"{name}.csv"
        np.savetxt(path, table[np.isfinite(table).all(axis=1)], "%.12g", ",", header=",".join(header), comments="")
        yield path
