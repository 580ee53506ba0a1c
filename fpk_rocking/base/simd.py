"""Eight numbers at once in kernels: a type with a number's arithmetic, which the compiler keeps in vector registers.

A loop over eight numbers may become vector instructions or not, by rules that a small change of the loop can upset. An
expression in these lanes always does.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

WIDTH = 8

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INDEX = ir.IntType(32)


class Lanes(types.Type):
    """The numba type of eight numbers."""

    def __init__(self):
        super().__init__(name="Lanes")


lanes = Lanes()


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


def _shuffled(builder, value, order):
    """Generate a vector of the elements of an LLVM vector `value` whose indices are `order`, a sequence of int."""
    mask = ir.Constant(ir.VectorType(_INDEX, len(order)), [ir.Constant(_INDEX, k) for k in order])
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)


def _spread(builder, value):
    """Generate the vector whose `WIDTH` elements are all the LLVM double `value`."""
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(_INDEX, 0))
    return _shuffled(builder, first, [0] * WIDTH)


def _define(operation, name):
    """Give `Lanes` an operation among themselves and with a number.

    `operation` is a function of `operator`, and `name` is the method of llvmlite's builder that does it.
    """
    operands = (lanes, lanes), (lanes, types.float64), (types.float64, lanes)

    @infer_global(operation)
    class _Template(ConcreteTemplate):
        cases = [signature(lanes, *pair) for pair in operands]  # noqa: RUF012  (as numba has it)

    def generate(context, builder, called, arguments):  # noqa: ARG001
        """Generate the operation; the arguments are those that numba passes to a code generator."""
        pair = zip(called.args, arguments, strict=True)
        vectors = (value if kind is lanes else _spread(builder, value) for kind, value in pair)
        return getattr(builder, name)(*vectors)

    for pair in operands:
        lower_builtin(operation, *pair)(generate)


for _operation, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _define(_operation, _name)


def _place(context, builder, kind, array, row):
    """Generate the pointer, to a vector, to the begin of a row of an array; row 0 where `row` is None.

    `kind` is the array's numba type; `array` and `row` are LLVM values.
    """
    struct = context.make_array(kind)(context, builder, array)
    start = builder.bitcast(struct.data, ir.IntType(8).as_pointer())
    if row is not None:
        start = builder.gep(start, [builder.mul(row, builder.extract_value(struct.strides, 0))])
    return builder.bitcast(start, _VECTOR.as_pointer())


_intrinsic: Callable[..., Callable[..., Any]] = intrinsic
"""Without the typing context, which a caller does not pass."""


@_intrinsic
def load(typing, array, row) -> Any:  # noqa: ARG001  (what numba passes)
    """Return the first eight numbers (`Lanes`) of a row of a contiguous array (n, m), m >= 8.

    Kernels pass the array and the row's index; numba adds `typing`.
    """

    def generate(context, builder, called, arguments):
        """Generate the load; the arguments are those that numba passes to a code generator."""
        return builder.load(_place(context, builder, called.args[0], *arguments), align=8)

    return lanes(array, types.intp), generate


@_intrinsic
def store(typing, array, row, value) -> Any:  # noqa: ARG001
    """Write `value`, `Lanes`, into the first eight numbers of a row of a contiguous array (n, m), m >= 8.

    Kernels pass the array, the row's index and the value; numba adds `typing`.
    """

    def generate(context, builder, called, arguments):
        """Generate the store; the arguments are those that numba passes to a code generator."""
        builder.store(arguments[2], _place(context, builder, called.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), generate


@_intrinsic(prefer_literal=True)
def spread(typing, value, lane) -> Any:  # noqa: ARG001
    """Return `Lanes` that all are one of the eight numbers of `value`, `Lanes`: the one of index `lane`, a literal.

    Kernels pass the value and the index; numba adds `typing`.
    """

    def generate(context, builder, called, arguments):  # noqa: ARG001
        """Generate the shuffle; the arguments are those that numba passes to a code generator."""
        return _shuffled(builder, arguments[0], [lane.literal_value] * WIDTH)

    return lanes(value, lane), generate


@_intrinsic
def total(typing, value) -> Any:  # noqa: ARG001
    """Return the sum of the eight numbers of `value`, `Lanes`; kernels pass it alone, numba adds `typing`."""

    def generate(context, builder, called, arguments):  # noqa: ARG001
        """Generate the sum by halves; the arguments are those that numba passes to a code generator."""
        sums, size = arguments[0], WIDTH
        while size > 1:
            size //= 2
            sums = builder.fadd(_shuffled(builder, sums, range(size)), _shuffled(builder, sums, range(size, 2 * size)))
        return builder.extract_element(sums, ir.Constant(_INDEX, 0))

    return types.float64(lanes), generate
