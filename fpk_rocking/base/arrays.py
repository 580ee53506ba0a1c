"""Arrays whose references a kernel need not count: that can cost more than a small kernel itself."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj


def scratch(rows: int, columns: int) -> Callable[[], Any]:
    """Return a function that makes an array (rows, columns), not initialized, on the stack of the kernel that calls it.

    The array lasts as long as the kernel, so nothing may return it.
    """
    array, word = types.Array(types.float64, 2, "C"), 8

    @intrinsic
    def make(typing):  # noqa: ARG001  (what numba passes)
        def reserve(context, builder, signature, arguments):  # noqa: ARG001
            place = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), rows * columns))
            found = arrayobj.make_array(array)(context, builder)
            arrayobj.populate_array(
                found,
                data=builder.bitcast(place, ir.DoubleType().as_pointer()),
                shape=[context.get_constant(types.intp, n) for n in (rows, columns)],
                strides=[context.get_constant(types.intp, n) for n in (columns * word, word)],
                itemsize=context.get_constant(types.intp, word),
                meminfo=None,
            )
            return found._getvalue()

        return array(), reserve

    return make


@intrinsic
def borrowed(typing, value):  # noqa: ARG001
    """Return an array, or a tuple with arrays, without ownership of the memory: no references to it are counted.

    Whoever calls the kernel has to own the arrays until it returns, as Python does the arguments of a kernel.
    """

    def disowned(context, builder, kind, item):
        if isinstance(kind, types.BaseTuple):
            items = zip(kind.types, cgutils.unpack_tuple(builder, item), strict=True)
            return context.make_tuple(builder, kind, [disowned(context, builder, *pair) for pair in items])
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, item)
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            return array._getvalue()
        return item

    def generate(context, builder, called, arguments):
        return disowned(context, builder, called.args[0], arguments[0])

    return value(value), generate


@intrinsic
def own(typing, value):  # noqa: ARG001
    """Keep an array, or a tuple with arrays, that a kernel made, up to this call: what is borrowed from it lasts."""
    return types.void(value), lambda context, *_: context.get_dummy_value()
