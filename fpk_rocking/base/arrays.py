"""Arrays in kernels: borrowed ones, whose references need not be counted, scratch on the stack, and SIMD vectors.

Counting the references of an array can cost more than a small kernel itself. The functions named `generate` write
LLVM code for numba: `context` and `builder` are numba's and llvmlite's, values are LLVM values, kinds numba types.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, lower_getattr_generic, models, register_model, type_callable

_intrinsic: Callable[..., Callable[..., Any]] = intrinsic
"""Without the typing context, which a caller does not pass."""


def scratch(rows: int, columns: int) -> Callable[[], Any]:
    """Make a function, for kernels, that returns an array (rows, columns) of floats on the stack of its caller.

    The array lasts as long as the kernel that calls, so nothing may return it. It holds what the last call left there.
    """
    kind, size = types.Array(types.float64, 2, "C"), rows * columns

    @intrinsic
    def make(typing):  # noqa: ARG001  (what numba passes)
        def generate(context, builder, signature, arguments):  # noqa: ARG001
            with builder.goto_entry_block():
                place = builder.alloca(ir.ArrayType(ir.DoubleType(), size))
                builder.store(place.type.pointee(None), place)
            word = context.get_value_type(types.intp)
            array = context.make_array(kind)(context, builder)
            array.data = builder.bitcast(place, ir.DoubleType().as_pointer())
            array.itemsize, array.nitems = word(8), word(size)
            array.shape = ir.Constant.literal_array([word(rows), word(columns)])
            array.strides = ir.Constant.literal_array([word(8 * columns), word(8)])
            array.meminfo, array.parent = array.meminfo.type(None), array.parent.type(None)
            return array._getvalue()

        return kind(), generate

    return make


class BorrowedTuple(types.NamedTuple):
    """The numba type of a named tuple with arrays that a kernel does not own."""

    def __init__(self, kind):
        super().__init__([_borrowed_type(field) for field in kind.types], kind.instance_class)
        self.name, self.owned = f"borrowed {kind}", kind


@register_model(BorrowedTuple)
class _BorrowedTuple(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, manager.lookup(kind.owned).get_value_type())


def _borrowed_type(kind):
    """Return a `BorrowedTuple` for the numba type of a named tuple with arrays, else the type itself."""
    if isinstance(kind, types.NamedTuple) and not isinstance(kind, BorrowedTuple) and _has_arrays(kind):
        return BorrowedTuple(kind)
    return kind


def _has_arrays(kind):
    """Whether a numba type is that of an array, or of a tuple with an array in it, at any depth."""
    return isinstance(kind, types.Array) or (isinstance(kind, types.BaseTuple) and any(map(_has_arrays, kind.types)))


@lower_getattr_generic(BorrowedTuple)
def _field(context, builder, borrowed, value, name):
    """Generate code that reads a field of a `BorrowedTuple` without ownership."""
    number = borrowed.fields.index(name)
    return _disowned(context, builder, borrowed.owned.types[number], builder.extract_value(value, number))


def _disowned(context, builder, kind, value):
    """Generate `value` without ownership of an array's memory; arrays of a named tuple are disowned when read."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.meminfo.type(None)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple) and not isinstance(kind, types.NamedTuple):
        return _disowned_items(context, builder, kind, kind, value)
    return value


def _disowned_items(context, builder, kind, result, value):
    """Generate a tuple of the type `result` of the items, without ownership, of a tuple of the type `kind`."""
    items = [builder.extract_value(value, number) for number in range(len(kind.types))]
    pairs = zip(kind.types, items, strict=True)
    return context.make_tuple(builder, result, [_disowned(context, builder, *pair) for pair in pairs])


@_intrinsic
def borrowed(typing, value):  # noqa: ARG001
    """Give an array, a named tuple with arrays, or a tuple of such, without ownership: references are not counted.

    Whoever calls the kernel has to own the arrays until it returns, as Python does the arguments of a kernel.
    """
    result = _borrowed_type(value)
    if isinstance(value, types.BaseTuple) and not isinstance(value, types.NamedTuple):
        result = types.Tuple([_borrowed_type(kind) for kind in value.types])

    def generate(context, builder, called, arguments):
        kind = called.args[0]
        if result is kind or not isinstance(result, types.BaseTuple):
            return _disowned(context, builder, kind, arguments[0])
        if isinstance(result, BorrowedTuple):
            return arguments[0]
        return _disowned_items(context, builder, kind, result, arguments[0])

    return result(value), generate


@_intrinsic
def own(typing, value):  # noqa: ARG001
    """Keep arrays that a kernel has made, and with them what is `borrowed` from them, alive up to this call."""
    return types.void(value), lambda context, *_: context.get_dummy_value()


WIDTH = 8

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INDEX = ir.IntType(32)


class Lanes(types.Type):
    """The numba type of eight floats in a vector register."""

    def __init__(self):
        super().__init__(name="Lanes")


lanes = Lanes()


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


def _shuffled(builder, value, order):
    """Generate a vector of the elements of `value` whose indices are `order`, a sequence of int."""
    mask = ir.Constant(ir.VectorType(_INDEX, len(order)), [ir.Constant(_INDEX, k) for k in order])
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)


def _spread(builder, value):
    """Generate a vector whose elements are all the float `value`."""
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(_INDEX, 0))
    return _shuffled(builder, first, [0] * WIDTH)


def _define(operation, name):
    """Let numba compile an operation (a function of `operator`) of `Lanes` with `Lanes` or a float.

    `name` is the method of llvmlite's builder that does it. The result are `Lanes`.
    """
    operands = (lanes, lanes), (lanes, types.float64), (types.float64, lanes)

    @type_callable(operation)
    def typed(context):  # noqa: ARG001
        def signature(first, second):
            pair = tuple(types.float64 if isinstance(kind, types.Number) else kind for kind in (first, second))
            return lanes(*pair) if pair in operands else None

        return signature

    def generate(context, builder, called, arguments):  # noqa: ARG001
        pairs = zip(called.args, arguments, strict=True)
        return getattr(builder, name)(*(value if kind is lanes else _spread(builder, value) for kind, value in pairs))

    for pair in operands:
        lower_builtin(operation, *pair)(generate)


for _operation, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _define(_operation, _name)


def _place(context, builder, kind, array, row):
    """Generate the pointer, to a vector, to where a row of an array starts."""
    struct = context.make_array(kind)(context, builder, array)
    start = builder.bitcast(struct.data, ir.IntType(8).as_pointer())
    start = builder.gep(start, [builder.mul(row, builder.extract_value(struct.strides, 0))])
    return builder.bitcast(start, _VECTOR.as_pointer())


@_intrinsic
def load(typing, array, row) -> Any:  # noqa: ARG001  (what numba passes)
    """Read the first eight numbers, as `Lanes`, of a row of a contiguous array (n, m), m >= 8."""

    def generate(context, builder, called, arguments):
        return builder.load(_place(context, builder, called.args[0], *arguments), align=8)

    return lanes(array, types.intp), generate


@_intrinsic
def store(typing, array, row, value) -> Any:  # noqa: ARG001
    """Write `value`, `Lanes`, into the first eight numbers of a row of a contiguous array (n, m), m >= 8."""

    def generate(context, builder, called, arguments):
        builder.store(arguments[2], _place(context, builder, called.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), generate


@_intrinsic(prefer_literal=True)
def spread(typing, value, lane) -> Any:  # noqa: ARG001
    """Give `Lanes` that are all the number of `value`, `Lanes`, whose index is `lane`, a literal."""

    def generate(context, builder, called, arguments):  # noqa: ARG001
        return _shuffled(builder, arguments[0], [lane.literal_value] * WIDTH)

    return lanes(value, lane), generate


@_intrinsic
def total(typing, value) -> Any:  # noqa: ARG001
    """Sum the eight numbers of `value`, `Lanes`, by halves."""

    def generate(context, builder, called, arguments):  # noqa: ARG001
        sums, size = arguments[0], WIDTH
        while size > 1:
            size //= 2
            sums = builder.fadd(_shuffled(builder, sums, range(size)), _shuffled(builder, sums, range(size, 2 * size)))
        return builder.extract_element(sums, ir.Constant(_INDEX, 0))

    return types.float64(lanes), generate
