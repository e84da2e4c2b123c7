"""Convolution of many channels with a few kernels, zero-phase, at every sample or every so many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.signal import oaconvolve

Array = NDArray[np.float64]

_PIECE = 64
"""Samples that the outputs of one row of the matrix product span that a convolution is …"""
_LEAST_PIECE = 16
"""… but so many outputs at least, …"""
_LONGEST_PRODUCT = 300
"""… up to so many taps; longer kernels are transformed."""


def convolve(x: Array, kernel: Array) -> Array:
    """Zero-phase convolution of (N, k) along the first axis, where the kernel lies wholly inside: (N − len + 1, k)."""
    result: Array = convolve_each(x, [kernel])[0]
    return result


def convolve_each(x: Array, kernels: Sequence[Array], stride: int = 1) -> Array:
    """`convolve` with several kernels of one length: (kernels, N − len + 1, k), each channel contiguous; of these
    samples every ``stride``-th.

    Short kernels as one matrix product: overlapping pieces of a channel times a band matrix that holds all kernels.
    """
    taps = len(kernels[0])
    if taps > _LONGEST_PRODUCT or len(x) < taps:
        return np.array([oaconvolve(x, kernel[:, None], mode="valid", axes=0)[::stride] for kernel in kernels])
    count, channels = -(-(len(x) - taps + 1) // stride), x.shape[1]
    piece = max(_LEAST_PIECE, _PIECE // stride)
    pieces, reach = -(-count // piece), (piece - 1) * stride
    band = np.zeros((len(kernels), taps + 2 * reach))
    band[:, reach : reach + taps] = [kernel[::-1] for kernel in kernels]
    shifted = sliding_window_view(band, taps + reach, axis=1)[:, ::-stride]
    matrix = shifted.reshape(-1, taps + reach).T
    padded = np.zeros((channels, pieces * piece * stride + taps - 1))
    padded[:, : len(x)] = x.T
    windows = sliding_window_view(padded, taps + reach, axis=1)[:, :: piece * stride]
    result = np.empty((len(kernels), channels, pieces, piece))
    for channel in range(channels):
        product = np.ascontiguousarray(windows[channel]) @ matrix
        result[:, channel] = product.reshape(pieces, len(kernels), piece).swapaxes(0, 1)
    return result.reshape(len(kernels), channels, -1)[:, :, :count].swapaxes(1, 2)
