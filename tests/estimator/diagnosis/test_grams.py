"""A block that is kept as rows says the same as one that is kept as products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from estimator import RigidBody
from estimator.base_parameters import base_parameters
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block, Sheet, part_of, total, total_anew
from estimator.diagnosis.observed.stretches import Channel

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def design(make_chain: Callable[..., RigidBody]) -> Design:
    """Two joints' torques; candidates on the first, on the second, and on both."""
    body = make_chain("rr")
    base = base_parameters(body)
    empty = Design(
        body,
        base,
        (Channel("torque", 0), Channel("torque", 1)),
        (),
        (),
        np.eye(base.rank + 2),
        (np.arange(base.rank), np.arange(1, base.rank)),
    )
    shapes = [((0,), 2), ((1,), 3), ((0, 1), 1)]
    return empty.with_candidates(
        [
            Candidate(k, np.zeros(0), np.arange(count), channels, np.full(count, -np.inf), np.full(count, np.inf))
            for k, (channels, count) in enumerate(shapes)
        ]
    )


@pytest.fixture
def sheets(design: Design) -> list[Sheet]:
    random = np.random.default_rng(5)
    return [
        Sheet(number, [random.normal(size=(len(members) + 1, rows)) for members in design.members], float(number))
        for number, rows in enumerate((4, 60, 9))
    ]


def test_the_sum_is_the_same_whatever_the_blocks_are_kept_as(sheets: list[Sheet]) -> None:
    whole = total([sheet.summed() for sheet in sheets])
    for blocks in (sheets, [sheet.compact() for sheet in sheets]):
        mixed = total(blocks)
        assert mixed.rows == whole.rows == 73
        for own, gram in zip(mixed.grams, whole.grams, strict=True):
            assert_allclose(own, gram, rtol=1e-12, atol=1e-12)


def test_the_smaller_of_rows_and_products_is_kept(sheets: list[Sheet]) -> None:
    assert [type(sheet.compact()) for sheet in sheets] == [Sheet, Block, Sheet]


def test_a_part_has_the_products_of_its_own_columns(design: Design, sheets: list[Sheet]) -> None:
    """In the part's own numbering: the candidates in the order in which they were asked for."""
    random = np.random.default_rng(6)
    part, blocks = part_of(design, [sheets[0], sheets[1].summed()], [2, 0])
    former = np.concatenate([np.arange(design.given), design.candidates[2].columns, design.candidates[0].columns])
    value = random.normal(size=part.size)
    wide = np.zeros(design.size)
    wide[former] = value
    for sheet, block in zip(sheets, blocks, strict=False):
        for channel, columns in enumerate(sheet.columns):
            residual = columns[-1] - wide[design.members[channel]] @ columns[:-1]
            direction = np.append(-value[part.members[channel]], 1.0)
            assert direction @ block.grams[channel] @ direction == pytest.approx(residual @ residual, rel=1e-12)


@pytest.mark.parametrize("kept_as_rows", [True, False])
def test_of_columns_made_anew_the_sum_is_made_anew(sheets: list[Sheet], kept_as_rows: bool) -> None:
    random, changed = np.random.default_rng(6), [np.array([0, 3]), np.zeros(0, dtype=np.intp)]
    blocks: list[Sheet | Block] = []
    for sheet in sheets:
        first = sheet.columns[0].copy()
        first[changed[0]] = random.normal(size=(2, sheet.rows))
        anew = replace(sheet, columns=[first, sheet.columns[1]])
        blocks.append(anew if kept_as_rows else anew.summed())
    before, whole = total(sheets), total(blocks)
    found = total_anew(before, blocks, changed)
    assert found.rows == whole.rows
    for own, gram in zip(found.grams, whole.grams, strict=True):
        assert_allclose(own, gram, rtol=1e-12, atol=1e-12)
    assert not np.allclose(found.grams[0], before.grams[0])
