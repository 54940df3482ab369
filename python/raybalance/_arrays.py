"""A caller's arrays as the native half takes them; what cannot be taken is refused by its argument's name."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def numbers(name: str, value: ArrayLike) -> NDArray[Any]:
    """`value` as an array of real numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}; give rows of equal length") from None
    if array.dtype.kind in "fiu" or array.size == 0 and array.dtype.kind != "O":
        return array
    if array.dtype.kind == "b":
        raise TypeError(f"{name}: these are truth values, not numbers")
    if array.dtype.kind == "c":
        raise TypeError(f"{name}: complex numbers; give the real parts")
    if array.dtype.kind == "O":
        raise TypeError(
            f"{name}: an array of Python objects; give one of numbers, such as "
            f"np.array({name}.tolist(), dtype=np.float32)"
        )
    raise TypeError(f"{name}: numbers are needed, not {array.dtype}")


def points(name: str, value: ArrayLike, what: str = "a row x, y, z for each") -> NDArray[Any]:
    """`value` as N × 3 numbers in rows that follow each other, float64 if it is, else float32."""
    array = numbers(name, value)
    if array.size == 0 and array.ndim <= 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name}: shape {array.shape} is not (N, 3): give {what}{_advice(name, array)}")
    # Integers that single precision does not hold have their digits in double precision.
    is_single = array.dtype == np.float32 or array.dtype.itemsize <= 2
    return np.ascontiguousarray(array, dtype=np.float32 if is_single else np.float64)


def _advice(name: str, array: NDArray[Any]) -> str:
    if array.ndim == 1 and array.size % 3 == 0:
        return f", such as {name}.reshape(-1, 3)"
    if array.ndim > 2 and array.shape[-1] == 3:
        return f", such as {name}.reshape(-1, 3)"
    if array.ndim == 2 and array.shape[0] == 3:
        return f", such as {name}.T"
    return ""


def single(array: NDArray[Any]) -> NDArray[np.float32]:
    """The same in single precision; numbers beyond it become infinite, without a word."""
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def limit(name: str, value: ArrayLike, rays: int) -> float | NDArray[np.float32]:
    """One number for all rays, or one for each."""
    array = numbers(name, value)
    if array.ndim == 0:
        return float(array)
    if array.shape != (rays,):
        raise ValueError(
            f"{name}: shape {array.shape} fits neither one number nor one for each of {rays} rays, ({rays},)"
        )
    return single(array)


def masks(value: ArrayLike, count: int, what: str = "faces") -> NDArray[np.uint32]:
    """`value` as that many masks of 32 bits."""
    array = numbers("masks", value)
    if array.shape != (count,):
        raise ValueError(f"masks: shape {array.shape}, but there are {count} {what}: give one for each, ({count},)")
    if array.dtype.kind == "f" and array.size:
        raise TypeError(f"masks: {array.dtype} numbers are no bits; give integers, such as masks.astype(np.uint32)")
    if array.size and not (0 <= int(array.min()) and int(array.max()) < 2**32):
        raise ValueError(f"masks: {int(array.min())} to {int(array.max())} are not from 0 to 2**32 - 1")
    return np.ascontiguousarray(array, dtype=np.uint32)


def faces(value: ArrayLike, vertices: int) -> NDArray[np.uint32]:
    """Faces as M × 3 rows of the vertices there are."""
    array = numbers("faces", value)
    if array.size == 0 and array.ndim <= 2:
        array = array.reshape(0, 3).astype(np.uint32)
    if array.ndim != 2 or array.shape[1] != 3:
        quads = ": split polygons into triangles first" if array.ndim == 2 and array.shape[1] > 3 else ""
        raise ValueError(
            f"faces: shape {array.shape} is not (M, 3): give three indices of vertices for each triangle"
            f"{quads or _advice('faces', array)}"
        )
    if array.dtype.kind == "f":
        raise TypeError(f"faces: {array.dtype} numbers are no indices; give integers, such as faces.astype(np.uint32)")
    if array.size:
        outside = (array < 0) | (array >= vertices)
        if outside.any():
            row = int(np.argmax(outside.any(axis=1)))
            index = int(array[row][outside[row]][0])
            advice = "; indices that count from 1: give faces - 1" if int(array.min()) == 1 and index == vertices else ""
            raise ValueError(
                f"faces: row {row} names vertex {index}, but vertices are numbered 0 to {vertices - 1}{advice}"
            )
    return np.ascontiguousarray(array, dtype=np.uint32)
