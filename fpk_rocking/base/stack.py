"""Arrays on the stack: scratch of a kernel that borrows, at no cost and without an owner."""

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
