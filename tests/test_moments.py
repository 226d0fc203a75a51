"""Moments add, shift and pool like the rows they stand for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import ParameterError
from casysid.moments import Moments
from casysid.moments_file import read_moments, write_moments

seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, rows: int = 40, columns: int = 4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(rows, columns)), rng.normal(size=rows)


@settings(max_examples=25, deadline=None)
@given(seeds, st.integers(1, 7), st.integers(1, 5))
def test_moments_of_concatenated_rows_add(seed, blocks, others):
    (x1, y1), (x2, y2) = draw_rows(seed), draw_rows(seed + 1, rows=23)
    both = Moments.from_rows(x1, y1, blocks=blocks) + Moments.from_rows(x2, y2, blocks=others)
    whole = Moments.from_rows(np.vstack([x1, x2]), np.append(y1, y2))
    assert both.blocks == blocks + others
    assert np.allclose(both.pooled().xx, whole.pooled().xx)
    assert np.allclose(both.pooled().xy, whole.pooled().xy)
    assert both.pooled().yy == pytest.approx(whole.pooled().yy)
    assert both.pooled().count == whole.pooled().count


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_residual_energy_is_that_of_the_rows(seed):
    x, y = draw_rows(seed)
    theta = np.random.default_rng(seed + 7).normal(size=4)
    moments = Moments.from_rows(x, y, blocks=3)
    truth = [
        [np.sum((yb - xb @ theta) ** 2)] for xb, yb in zip(np.array_split(x, 3), np.array_split(y, 3), strict=True)
    ]
    assert np.allclose(moments.residual_energy(theta), truth)
    assert moments.pooled().residual_energy(theta) == pytest.approx(np.sum(truth))


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_shifting_is_subtracting_a_prediction(seed):
    x, y = draw_rows(seed)
    theta = np.random.default_rng(seed + 7).normal(size=4)
    shifted = Moments.from_rows(x, y, blocks=2).shifted(theta)
    direct = Moments.from_rows(x, y - x @ theta, blocks=2)
    assert np.allclose(shifted.gram, direct.gram)


def draw_sparse(seed: int) -> tuple[Moments, np.ndarray, np.ndarray]:
    """Three joints with columns of their own, and the same sums and noise among all columns."""
    rng = np.random.default_rng(seed)
    blocks, joints, p = 4, 3, 6
    gram, noise = np.zeros((2, blocks, joints, p + 1, p + 1))
    for joint in range(joints):
        places = np.append(np.flatnonzero(rng.random(p) < 0.6), p)
        for sums in (gram, noise):
            rows = rng.normal(size=(blocks, 9, len(places)))
            sums[:, joint, places[:, None], places] = np.swapaxes(rows, 1, 2) @ rows
    count = rng.integers(1, 9, (blocks, joints))
    names = tuple("abcdef"), ("one", "two", "three")
    return Moments.from_dense(gram, count, *names, noise=noise, noise_error=0.2), gram, noise


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_a_joints_own_columns_hold_all_there_is(seed):
    moments, gram, noise = draw_sparse(seed)
    assert np.array_equal(moments.gram, gram)
    assert np.array_equal(moments.dense_noise, noise)
    for joint in range(3):
        columns, squares = moments.of_joint(joint)
        assert np.array_equal(columns, np.flatnonzero(gram[:, joint, :-1, -1].any(axis=0)))
        assert squares.shape == (4, len(columns) + 1, len(columns) + 1)


@settings(max_examples=25, deadline=None)
@given(seeds, st.permutations(range(6)), st.integers(0, 6))
def test_a_smaller_model_is_read_off_a_larger_one(seed, order, size):
    moments, gram, noise = draw_sparse(seed)
    chosen = np.array(order[:size], dtype=int)
    places = np.append(chosen, 6)
    smaller = moments.select_columns(chosen)
    assert smaller.columns == tuple("abcdef"[k] for k in chosen)
    assert np.array_equal(smaller.gram, gram[:, :, places[:, None], places])
    assert np.array_equal(smaller.dense_noise, noise[:, :, places[:, None], places])
    assert smaller.noise_error == moments.noise_error


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_sums_over_blocks_and_joints_are_those_of_all_columns(seed):
    moments, gram, noise = draw_sparse(seed)
    weights = np.random.default_rng(seed).uniform(0.1, 3.0, 3)
    wanted, added = (np.einsum("j,bjmn->bmn", weights, sums) for sums in (gram, noise))
    assert np.allclose(list(moments.by_block(weights)), wanted)
    assert np.allclose(moments.pooled(weights).xx, wanted.sum(axis=0)[:-1, :-1])
    assert np.allclose(moments.pooled(weights).xy, wanted.sum(axis=0)[:-1, -1])
    assert np.allclose(moments.pooled_noise(weights), added.sum(axis=0))
    folds = moments.merged_blocks([[0, 2], [3], np.arange(4) < 2])
    assert np.allclose(folds.gram, [gram[[0, 2]].sum(axis=0), gram[3], gram[:2].sum(axis=0)])
    assert np.array_equal(folds.count[0], moments.count[0] + moments.count[2])


@settings(max_examples=25, deadline=None)
@given(seeds, seeds)
def test_joints_with_other_columns_add_as_well(one, other):
    (first, gram, noise), (second, more, louder) = draw_sparse(one), draw_sparse(other)
    both = first + second
    assert np.array_equal(both.gram, np.concatenate([gram, more]))
    assert np.array_equal(both.dense_noise, np.concatenate([noise, louder]))


@pytest.mark.parametrize("columns", [[0, 0], [6], [-1], [[0, 1]]])
def test_columns_that_are_not_there_cannot_be_selected(columns):
    with pytest.raises(ParameterError, match=r"wanted distinct columns among 0 \.\. 5"):
        draw_sparse(0)[0].select_columns(columns)


def test_columns_of_a_row_ascend():
    with pytest.raises(ParameterError, match="must ascend"):
        Moments((np.ones((1, 3, 3)),), (np.array([1, 0]),), np.ones((1, 1)), ("a", "b"), ("j",))
    with pytest.raises(ParameterError, match=r"squares of j must have shape \(1, 2, 2\)"):
        Moments((np.ones((1, 3, 3)),), (np.array([1]),), np.ones((1, 1)), ("a", "b"), ("j",))


def test_weights_multiply_the_rows_of_their_joint():
    x, y = draw_rows(0)
    one = Moments.from_rows(x, y)
    two = Moments.from_dense(
        np.concatenate([one.gram, 4 * one.gram], axis=1), np.tile(one.count, 2), one.columns, ("a", "b")
    )
    assert np.allclose(two.pooled([1.0, 0.25]).xx, 2 * one.pooled().xx)


def test_arrays_are_copies_and_read_only():
    gram = np.eye(3)[None, None].copy()
    moments = Moments.from_dense(gram, np.ones((1, 1)), ("a", "b"), ("j",))
    gram[:] = 7
    assert np.array_equal(moments.gram[0, 0], np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        moments.gram[0, 0, 0, 0] = 1


@pytest.mark.parametrize(
    ("gram", "count", "message"),
    [
        (np.ones((1, 1, 2, 2)), np.ones((1, 1)), r"shape \(blocks, 1, 3, 3\)"),
        (np.ones((1, 1, 3, 3)), np.ones((2, 1)), r"count must have shape \(1, 1\)"),
        (np.full((1, 1, 3, 3), np.nan), np.ones((1, 1)), "must be finite"),
    ],
)
def test_wrong_shapes_are_named(gram, count, message):
    with pytest.raises(ParameterError, match=message):
        Moments.from_dense(gram, count, ("a", "b"), ("j",))


def test_only_like_moments_add():
    x, y = draw_rows(0)
    with pytest.raises(ParameterError, match="same columns and joints"):
        Moments.from_rows(x, y) + Moments.from_rows(x[:, :3], y)


def test_moments_on_disk_are_read_back_as_one_block(tmp_path):
    rng = np.random.default_rng(3)
    moments = Moments.from_rows(rng.normal(size=(50, 3)), rng.normal(size=50), columns=("a", "b", "c"), blocks=4)
    write_moments(moments, tmp_path / "moments.npz")
    back = read_moments(tmp_path / "moments.npz")
    assert (back.columns, back.joints, back.blocks) == (moments.columns, moments.joints, 1)
    np.testing.assert_allclose(back.pooled().xx, moments.pooled().xx)
    assert back.pooled().count == moments.pooled().count
    assert [path.name for path in tmp_path.iterdir()] == ["moments.npz"]


def test_moments_on_disk_keep_every_joints_own_columns(tmp_path):
    moments, gram, _ = draw_sparse(1)
    write_moments(moments, tmp_path / "moments.npz")
    back = read_moments(tmp_path / "moments.npz")
    assert back.noise is None
    assert all(map(np.array_equal, back.row_columns, moments.row_columns))
    assert np.array_equal(back.gram[0], gram.sum(axis=0))


def test_moments_of_the_first_version_are_read(tmp_path):
    moments, gram, _ = draw_sparse(2)
    sums = {"gram": gram[:1], "count": moments.count[:1]}
    np.savez(tmp_path / "moments.npz", **sums, columns=list(moments.columns), joints=list(moments.joints))
    assert np.array_equal(read_moments(tmp_path / "moments.npz").gram, gram[:1])


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 cut off"])
def test_what_is_no_moments_file_is_refused(tmp_path, content):
    path = tmp_path / "moments.npz"
    path.write_bytes(content)
    with pytest.raises(ParameterError, match=r"moments\.npz: these are no moments"):
        read_moments(path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gram": np.full((1, 1, 3, 3), 1j)}, "holds complex128"),
        ({"gram": -np.ones((1, 1, 3, 3))}, "no sums of squares"),
        ({"gram": np.triu(np.ones((1, 1, 3, 3)))}, "no sums of squares"),
        ({"gram": np.full((1, 1, 3, 3), np.nan)}, "must be finite"),
        ({"count": np.full((1, 1), -1.0)}, "a count is negative"),
        ({"columns": np.array(["a", "a"])}, "a column is there twice"),
        ({"columns": np.array([object()], dtype=object)}, "these are no moments"),
    ],
)
def test_what_are_no_sums_is_not_read(changed, message, tmp_path):
    content = {
        "gram": np.ones((1, 1, 3, 3)),
        "count": np.ones((1, 1)),
        "columns": np.array(["a", "b"]),
        "joints": np.array(["j"]),
    }
    np.savez(tmp_path / "good.npz", **content)
    assert read_moments(tmp_path / "good.npz").columns == ("a", "b")
    np.savez(tmp_path / "bad.npz", **content | changed)
    with pytest.raises(ParameterError, match=message):
        read_moments(tmp_path / "bad.npz")
