"""What of a wrist sensor's record can be read: cut off, dead, with holes; and that the load comes out right without."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config import InputError
from estimator.loads import align_wrench, identify_load
from estimator.plausibility import readable_wrench


def test_a_sound_record_stays_as_it_is(loaded_puma: Any) -> None:
    arm = loaded_puma
    wrench = arm.recording().wrench
    usable, told = readable_wrench("r", arm.t, wrench)
    assert np.array_equal(usable, wrench)
    assert told == []


def test_a_channel_cut_off_at_an_unknown_range_does_not_spoil_the_load(loaded_puma: Any) -> None:
    arm = loaded_puma
    recording = arm.recording()
    top = np.quantile(recording.wrench[:, 2], 0.9)
    cut = np.array(recording.wrench)
    cut[:, 2] = np.minimum(cut[:, 2], top)
    usable, told = readable_wrench("r", arm.t, cut)
    assert len(told) == 1 and "fz stands at the end of its range in 10 %" in told[0]
    found = identify_load(arm.body, "tool", [align_wrench(recording.motion, arm.t, usable)])
    assert abs(float(found.load.mass.value) - arm.mass) < 5.0 * float(found.load.mass.standard_error)
    assert found.rigid.verdict == "rigid"
    # As it stands the flat top passes for a load that is not rigid.
    assert identify_load(arm.body, "tool", [replace(recording, wrench=cut)]).rigid.verdict == "not rigid"


def test_dead_channels_and_gaps_are_named(loaded_puma: Any) -> None:
    arm = loaded_puma
    wrench = np.array(arm.recording().wrench)
    wrench[:, 5] = 0.25
    wrench[400:420] = np.nan
    kept = np.ones(len(arm.t), dtype=np.bool_)
    kept[900:950] = False
    usable, told = readable_wrench("r", arm.t[kept], wrench[kept])
    assert np.isnan(usable[:, 5]).all()
    assert told == [
        "r: nz never changes: left out as dead",
        "r: 20 incomplete samples of the wrench and 1 gaps are left out",
    ]


def test_a_sensor_that_never_changes_is_refused(loaded_puma: Any) -> None:
    with pytest.raises(InputError, match="no channel of the wrench ever changes"):
        readable_wrench("r", loaded_puma.t, np.ones((len(loaded_puma.t), 6)))
