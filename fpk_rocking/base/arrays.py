"""Arrays in kernels: borrowed ones, whose references need not be counted, scratch on the stack, and SIMD vectors.

Counting the references of an array can cost more than a small kernel itself.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, ConcreteTemplate, infer_getattr, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model
from numba.np import arrayobj

_intrinsic: Callable[..., Callable[..., Any]] = intrinsic
"""Without the typing context, which a caller does not pass."""


def scratch(rows: int, columns: int) -> Callable[[], Any]:
    """Return a function, for kernels, that returns an array (rows, columns) of float on the stack of its caller.

    The array is not initialized, and lasts as long as the kernel that calls, so nothing may return it.
    """
    array, word = types.Array(types.float64, 2, "C"), 8

    @intrinsic
    def make(typing):  # noqa: ARG001  (what numba passes)
        """Return the array, as a kernel calls it, without an argument; numba adds `typing`."""

        def reserve(context, builder, signature, arguments):  # noqa: ARG001
            """Generate the array as an LLVM value; the arguments are those that numba passes to a code generator."""
            place = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), rows * columns))
            struct = arrayobj.make_array(array)(context, builder)
            arrayobj.populate_array(
                struct,
                data=builder.bitcast(place, ir.DoubleType().as_pointer()),
                shape=[context.get_constant(types.intp, n) for n in (rows, columns)],
                strides=[context.get_constant(types.intp, n) for n in (columns * word, word)],
                itemsize=context.get_constant(types.intp, word),
                meminfo=None,
            )
            return struct._getvalue()

        return array(), reserve

    return make


class BorrowedTuple(types.Type):
    """The numba type of a named tuple with arrays that a kernel does not own."""

    def __init__(self, kind):
        self.kind = kind
        super().__init__(name=f"borrowed {kind}")


@register_model(BorrowedTuple)
class _BorrowedTuple(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, manager.lookup(kind.kind).get_value_type())


def _borrowed_type(kind):
    """Return the numba type of what `borrowed` makes of a value of numba type `kind`.

    It is a `BorrowedTuple` for a named tuple with arrays, else `kind` itself.
    """
    return BorrowedTuple(kind) if isinstance(kind, types.NamedTuple) and _has_arrays(kind) else kind


def _has_arrays(kind):
    """Whether the numba type `kind` is an array's, or that of a tuple with an array in it, at any depth."""
    return isinstance(kind, types.Array) or (isinstance(kind, types.BaseTuple) and any(map(_has_arrays, kind.types)))


@infer_getattr
class _Fields(AttributeTemplate):
    key = BorrowedTuple

    def generic_resolve(self, borrowed, name):
        """Return the numba type of the field `name` of a `BorrowedTuple`, None where it has no such field."""
        fields = borrowed.kind.fields
        return _borrowed_type(borrowed.kind.types[fields.index(name)]) if name in fields else None


@lower_getattr_generic(BorrowedTuple)
def _field(context, builder, borrowed, value, name):
    """Generate code that reads the field `name` of a `BorrowedTuple`, for numba; return the field's LLVM value.

    `value` is the tuple's LLVM value and `borrowed` its numba type. The field does not own its memory. `context` and
    `builder` are numba's target context and llvmlite's builder, as in all generators here.
    """
    number = borrowed.kind.fields.index(name)
    return _disowned(context, builder, borrowed.kind.types[number], builder.extract_value(value, number))


def _disowned(context, builder, kind, value):
    """Return an LLVM `value` of the numba type `kind` without ownership of an array's memory.

    The arrays of a named tuple are disowned when read.
    """
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple) and not isinstance(kind, types.NamedTuple):
        items = zip(kind.types, cgutils.unpack_tuple(builder, value), strict=True)
        return context.make_tuple(builder, kind, [_disowned(context, builder, *pair) for pair in items])
    return value


@_intrinsic
def borrowed(typing, value):  # noqa: ARG001
    """Return an array or a named tuple with arrays, or a tuple of such, without ownership of the memory.

    No references to it are counted. Whoever calls the kernel has to own the arrays until it returns, as Python does the
    arguments of a kernel. Kernels pass `value` alone; numba adds `typing`.
    """
    result = _borrowed_type(value)
    if isinstance(value, types.BaseTuple) and not isinstance(value, types.NamedTuple):
        result = types.Tuple([_borrowed_type(kind) for kind in value.types])

    def generate(context, builder, called, arguments):
        """Generate the LLVM value without ownership; the arguments are those that numba passes to a code generator."""
        if result is called.args[0] or not isinstance(result, types.BaseTuple):
            return _disowned(context, builder, called.args[0], arguments[0])
        items = zip(called.args[0].types, cgutils.unpack_tuple(builder, arguments[0]), strict=True)
        return context.make_tuple(builder, result, [_disowned(context, builder, *pair) for pair in items])

    return result(value), generate


@_intrinsic
def own(typing, value):  # noqa: ARG001
    """Keep an array, or a tuple with arrays, that a kernel made, alive up to this call, which returns nothing.

    What is `borrowed` from it lasts so long.
    Kernels pass `value` alone; numba adds `typing`.
    """
    return types.void(value), lambda context, *_: context.get_dummy_value()


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
    """Return an LLVM vector of the elements of an LLVM vector `value` whose indices are `order`, a sequence of int.

    `builder`: llvmlite's, which gets the instruction.
    """
    mask = ir.Constant(ir.VectorType(_INDEX, len(order)), [ir.Constant(_INDEX, k) for k in order])
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)


def _spread(builder, value):
    """Return the LLVM vector whose `WIDTH` elements are all the LLVM double `value`; `builder`: llvmlite's."""
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(_INDEX, 0))
    return _shuffled(builder, first, [0] * WIDTH)


def _define(operation, name):
    """Let numba compile an operation among `Lanes` and of `Lanes` with a float; its result are `Lanes`.

    `operation` is a function of Python's `operator`, and `name` is the method of llvmlite's builder that does it.
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
    """Return the LLVM pointer, to a vector, to the begin of a row of an array; row 0 where `row` is None.

    `kind` is the array's numba type; `array` and `row` are LLVM values.
    """
    struct = context.make_array(kind)(context, builder, array)
    start = builder.bitcast(struct.data, ir.IntType(8).as_pointer())
    if row is not None:
        start = builder.gep(start, [builder.mul(row, builder.extract_value(struct.strides, 0))])
    return builder.bitcast(start, _VECTOR.as_pointer())


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
