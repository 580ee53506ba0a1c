"""Arrays whose references a kernel need not count: that can cost more than a small kernel itself."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model
from numba.np import arrayobj

_intrinsic: Callable[..., Callable[..., Any]] = intrinsic
"""Without the typing context, which a caller does not pass."""


def scratch(rows: int, columns: int) -> Callable[[], Any]:
    """Return a function that makes an array (rows, columns), not initialized, on the stack of the kernel that calls it.

    The array lasts as long as the kernel, so nothing may return it.
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
    """Numba type of what `borrowed` makes of a value of type `kind`: another for a named tuple with arrays only."""
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
    """Generate code that reads the field `name` of `value`, a `BorrowedTuple`, without owning its memory; for numba.

    `context` and `builder` are numba's target context and llvmlite's builder, as in all generators here.
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
    """Keep an array, or a tuple with arrays, that a kernel made, up to this call: what is borrowed from it lasts.

    Kernels pass `value` alone; numba adds `typing`.
    """
    return types.void(value), lambda context, *_: context.get_dummy_value()
