"""The two values that everything else is written in: `Affine` maps and `Quadratic` costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    Value,
    as_array,
    as_instance,
    as_integer,
    as_number,
    as_positive,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.errors import InputError

MAX_VARIABLES = 10_000  # a matrix with as many rows and columns takes 0.8 GB
CURVATURE_TOLERANCE = 1e-12  # curvature below this part of the largest counts as none
# part of the largest curvature that one may be negative by: rounding of pullbacks
_NEGATIVE_CURVATURE_TOLERANCE = 1e-9
# part of 1 + the largest |g| that a slope without curvature may have: rounding of pullbacks
_SLOPE_TOLERANCE = 1e-7

_NO_BLOCKS: Mapping[str, slice] = MappingProxyType({})


@dataclass(frozen=True, eq=False, init=False)
class Affine(Value):
    """The map x -> A x + b.

    A: shape (m, n); b: shape (m,). `blocks` names slices of the output: `f["tau"]` is the `Affine`
        of those rows.
    Raises `InputError` when the shapes do not fit or an entry is not finite.
    """

    A: Array
    b: Array
    blocks: Mapping[str, slice]
    __array_ufunc__ = None  # array + map is ours to add up, and so are array * map and array @ map

    def __init__(
        self, A: npt.ArrayLike, b: npt.ArrayLike, blocks: Mapping[str, slice] = _NO_BLOCKS
    ):
        values = self.__dict__  # written to directly: user-defined tasks make one at every tick
        values["A"] = A = as_array("A", A, (None, None))
        values["b"], values["blocks"] = as_array("b", b, (len(A),)), as_blocks(blocks)

    @staticmethod
    def linear(A: npt.ArrayLike) -> Affine:
        """The map x -> A x."""
        A = as_array("A", A, (None, None))
        return Affine(A, np.zeros(A.shape[0]))

    @staticmethod
    def identity(n: int) -> Affine:
        """The map x -> x on R^n."""
        return _identity(as_dimension("n", n))

    @staticmethod
    def constant(b: npt.ArrayLike, n: int) -> Affine:
        """The map x -> b for every x in R^n."""
        b = as_array("b", b, (None,))
        return Affine(np.zeros((b.size, as_dimension("n", n))), b)

    @staticmethod
    def stack(**parts: Affine) -> Affine:
        """One map whose output is the outputs of `parts` one after the other, as blocks of those
        names.
        """
        if not parts:
            raise InputError("stack needs at least one map.")
        widths = {name: as_instance(name, f, Affine).n_in for name, f in parts.items()}
        if len(set(widths.values())) > 1:
            raise InputError(
                f"maps that are stacked must start from the same space; input sizes: {widths}."
            )
        ends = np.cumsum([f.n_out for f in parts.values()])
        blocks = {
            name: slice(int(end) - f.n_out, int(end))
            for (name, f), end in zip(parts.items(), ends, strict=True)
        }
        A = np.vstack([f.A for f in parts.values()])
        return Affine(A, np.concatenate([f.b for f in parts.values()]), blocks)

    @property
    def n_in(self) -> int:
        """Size of x."""
        return int(self.A.shape[1])

    @property
    def n_out(self) -> int:
        """Size of A x + b."""
        return int(self.A.shape[0])

    def __call__(self, x: npt.ArrayLike) -> Array:
        """The value A x + b; x of shape (n,), or (n, N) for N points side by side."""
        numeric = numeric_copy(x)
        x = as_array("x", x, (self.n_in,)) if numeric is None else numeric
        if x.ndim not in (1, 2) or x.shape[0] != self.n_in:
            raise InputError(
                f"x has shape {x.shape}; this map takes shape ({self.n_in},) or ({self.n_in}, N)."
            )
        x = as_array("x", x, x.shape)
        return self.A @ x + (self.b if x.ndim == 1 else self.b[:, None])

    def __getitem__(self, block: str) -> Affine:
        """The rows of one named block."""
        if not isinstance(block, str) or block not in self.blocks:
            raise InputError(
                f"this map has no block {block!r}; its blocks are {list(self.blocks)}."
            )
        rows = self.blocks[block]
        return Affine(self.A[rows], self.b[rows])

    def __matmul__(self, inner: Affine) -> Affine:
        """Composition: (f @ g)(x) = f(g(x)). Keeps the block names of f."""
        if not isinstance(inner, Affine):
            raise InputError(
                "only maps can be composed; the value of f at x is f(x), and Affine.linear(B) is a "
                "matrix's map."
            )
        if inner.n_out != self.n_in:
            raise InputError(
                f"cannot compose: the inner map gives {inner.n_out} numbers, the outer takes "
                f"{self.n_in}."
            )
        return Affine(self.A @ inner.A, self.A @ inner.b + self.b, self.blocks)

    def __add__(self, other: Affine | npt.ArrayLike) -> Affine:
        """The sum of two maps with the same sizes, or of a map and a constant vector of shape (m,)."""
        if isinstance(other, Affine):
            if other.A.shape != self.A.shape:
                raise InputError(f"cannot add maps of shapes {self.A.shape} and {other.A.shape}.")
            return Affine(self.A + other.A, self.b + other.b, self.blocks)
        return Affine(self.A, self.b + as_array("the constant", other, (self.n_out,)), self.blocks)

    def __sub__(self, other: Affine | npt.ArrayLike) -> Affine:
        return self + (
            -1.0 * other
            if isinstance(other, Affine)
            else -as_array("the constant", other, (self.n_out,))
        )

    def __radd__(self, other: npt.ArrayLike) -> Affine:
        """constant + map, the same as map + constant."""
        return self + other

    def __rsub__(self, other: npt.ArrayLike) -> Affine:
        """The map x -> other - (A x + b)."""
        return -self + other

    def __rmul__(self, scale: float) -> Affine:
        """The map x -> scale (A x + b)."""
        scale = _as_factor("map", scale)
        return Affine(scale * self.A, scale * self.b, self.blocks)

    def __mul__(self, scale: float) -> Affine:
        """The same as scale * map."""
        return self.__rmul__(scale)

    def __rmatmul__(self, outer: npt.ArrayLike) -> Affine:
        """matrix @ map: the map x -> outer (A x + b), outer of shape (p, m)."""
        return Affine.linear(as_array("the matrix", outer, (None, self.n_out))) @ self

    def __neg__(self) -> Affine:
        return -1.0 * self

    def __iter__(self) -> Iterator[Array]:
        """Unpacks as `A, b = f`."""
        return iter((self.A, self.b))


@dataclass(frozen=True, eq=False)
class Quadratic(Value):
    """The cost x -> ½ xᵀ H x + gᵀ x + c.

    H: shape (n, n), made symmetric; g: shape (n,); c: a number. Raises `InputError` when the shapes
        do not fit.
    """

    H: Array
    g: Array
    c: float = 0.0
    __array_ufunc__ = None  # array * cost is ours to refuse

    def __post_init__(self) -> None:
        g = as_array("g", self.g, (None,))
        H = as_array("H", self.H, (g.size, g.size))
        object.__setattr__(self, "g", g)
        object.__setattr__(self, "H", read_only(0.5 * (H + H.T)))
        object.__setattr__(self, "c", as_number("c", self.c))

    @staticmethod
    def from_residual(A: npt.ArrayLike, r: npt.ArrayLike, weight: float = 1.0) -> Quadratic:
        """The cost (weight / 2) ‖A x - r‖²; A: shape (m, n), r: shape (m,)."""
        A = as_array("A", A, (None, None))
        r = as_array("r", r, (A.shape[0],))
        w = as_positive("weight", weight, allow_zero=True)
        return Quadratic(w * A.T @ A, -w * A.T @ r, 0.5 * w * float(r @ r))

    @staticmethod
    def from_affine(residual: Affine, weight: float = 1.0) -> Quadratic:
        """The cost (weight / 2) ‖residual(x)‖²."""
        return Quadratic.from_residual(
            as_instance("residual", residual, Affine).A, -residual.b, weight
        )

    @staticmethod
    def zero(n: int) -> Quadratic:
        """The cost that is zero everywhere on R^n."""
        return Quadratic(np.zeros((as_dimension("n", n), n)), np.zeros(n))

    @property
    def n(self) -> int:
        """Size of x."""
        return int(self.g.size)

    def __call__(self, x: npt.ArrayLike) -> float:
        """The cost at x, shape (n,)."""
        x = as_array("x", x, (self.n,))
        return float(0.5 * x @ self.H @ x + self.g @ x + self.c)

    def gradient(self, x: npt.ArrayLike) -> Array:
        """H x + g at x, shape (n,)."""
        return self.H @ as_array("x", x, (self.n,)) + self.g

    def pullback(self, f: Affine) -> Quadratic:
        """(15)(18) The same cost seen from the space that f starts in: x -> self(f(x)). Source:
        [FBR], §3.
        """
        if as_instance("f", f, Affine).n_out != self.n:
            raise InputError(
                f"cannot pull back: the map gives {f.n_out} numbers, the cost takes {self.n}."
            )
        return Quadratic(f.A.T @ self.H @ f.A, f.A.T @ (self.H @ f.b + self.g), self(f.b))

    def minimiser(self) -> Array:
        """The minimiser of smallest norm, shape (n,). Raises `InputError` where the cost has no
        minimum.
        """
        return self.argmin_over(np.eye(self.n)).b

    def argmin_over(self, N: npt.ArrayLike) -> Affine:
        """x -> the point of least cost on x + span N; N: orthonormal columns, shape (n, p).

        The cost there is `self.pullback(self.argmin_over(N))`. A direction that costs nothing is
        left alone. Raises `InputError` where the cost falls for ever along a column of N: negative
        curvature, or slope without curvature.
        """
        N = as_array("N", N, (self.n, None))
        values, vectors = np.linalg.eigh(N.T @ self.H @ N)
        largest = float(np.abs(values).max(initial=0.0))
        if values.size and values[0] < -_NEGATIVE_CURVATURE_TOLERANCE * largest:
            raise InputError(f"the cost has no minimum: its smallest curvature is {values[0]:.3g}.")
        curved = values > CURVATURE_TOLERANCE * largest
        slope = vectors.T @ (N.T @ self.g)
        if np.any(
            np.abs(slope[~curved])
            > _SLOPE_TOLERANCE * (1.0 + float(np.abs(self.g).max(initial=0.0)))
        ):
            raise InputError(
                "the cost has no minimum: it falls for ever along a direction without curvature. "
                "Add a cost there."
            )
        W = N @ vectors[:, curved]
        step = W / values[curved]
        return Affine(np.eye(self.n) - step @ (W.T @ self.H), -step @ slope[curved])

    def __add__(self, other: Quadratic) -> Quadratic:
        if not isinstance(other, Quadratic):
            return NotImplemented
        if other.n != self.n:
            raise InputError(f"cannot add costs over {self.n} and {other.n} numbers.")
        return Quadratic(self.H + other.H, self.g + other.g, self.c + other.c)

    def __rmul__(self, scale: float) -> Quadratic:
        scale = _as_factor("cost", scale)
        return Quadratic(scale * self.H, scale * self.g, scale * self.c)

    def __mul__(self, scale: float) -> Quadratic:
        """The same as scale * cost."""
        return self.__rmul__(scale)


def _as_factor(kind: str, scale: object) -> float:
    """The number that a map or cost is multiplied by; `InputError` with advice for anything else."""
    factor = numeric_copy(scale)
    if factor is not None and factor.ndim == 0 and abs(factor) <= MAX_MAGNITUDE:
        return float(factor)
    what = (
        f"an array of shape {scale.shape}" if isinstance(scale, np.ndarray) else short_repr(scale)
    )
    raise InputError(
        f"a {kind} can be multiplied by a finite number, not by {what}; to compose maps write f @ "
        f"g."
    )


def as_dimension(name: str, n: int) -> int:
    """The number of variables of a map or a cost."""
    return as_integer(name, n, 0, MAX_VARIABLES, "more make matrices that no memory holds")


@lru_cache(maxsize=64)
def _identity(n: int) -> Affine:
    return Affine(np.eye(n), np.zeros(n))


def as_blocks(blocks: Mapping[str, slice]) -> Mapping[str, slice]:
    """A read-only copy of names of slices, checked."""
    if blocks is _NO_BLOCKS or (type(blocks) is dict and not blocks):
        return _NO_BLOCKS  # most maps have none
    if isinstance(blocks, Mapping) and all(
        isinstance(k, str) and isinstance(v, slice) for k, v in blocks.items()
    ):
        return MappingProxyType(dict(blocks))
    raise InputError(
        f'blocks must be names of slices, as {{"tau": slice(0, 12)}}, not {short_repr(blocks)}.'
    )
