"""Forces from outside on the model's bodies: walls and pushes."""

from __future__ import annotations

import mujoco
import numpy as np

from virtual_hw.hidden.contact import Push, Wall
from virtual_hw.hidden.mechanics import HiddenMechanics


class OutsideForces:
    """Writes ``xfrc_applied`` from the positions of the model's last evaluation, one step late."""

    def __init__(self, hidden: HiddenMechanics, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._walls = [(w, model.body(w.link).id) for w in hidden.wall]
        self._pushes = [(p, model.body(p.link).id) for p in hidden.push]

    def __bool__(self) -> bool:
        return bool(self._walls or self._pushes)

    def apply(self, t: float) -> None:
        self._data.xfrc_applied[:] = 0.0
        for wall, body in self._walls:
            self._press(wall, body)
        for push, body in self._pushes:
            self._push(push, body, t)

    def _press(self, wall: Wall, body: int) -> None:
        data = self._data
        arm = data.xmat[body].reshape(3, 3) @ np.asarray(wall.at_m)
        motion = np.empty(6)
        mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_XBODY, body, motion, 0)
        force = wall.force(data.xpos[body] + arm, motion[3:] + np.cross(motion[:3], arm))
        if force is not None:
            self._add(body, data.xpos[body] + arm, force)

    def _push(self, push: Push, body: int, t: float) -> None:
        if push.from_s <= t < push.until_s:
            data = self._data
            at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ np.asarray(push.at_m)
            self._add(body, at, np.asarray(push.force_n))

    def _add(self, body: int, at: np.ndarray, force: np.ndarray) -> None:
        wrench = self._data.xfrc_applied[body]
        wrench[:3] += force
        wrench[3:] += np.cross(at - self._data.xipos[body], force)
