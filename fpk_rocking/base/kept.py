"""Machine code on the disk, loaded without the compiler.

Before numba looks for a kernel on the disk it makes itself ready to compile: it imports all that it can compile, and
scipy's linear algebra to see whether that is there. That takes longer than to load all kernels of a run. Here it is
done only where a kernel has to be compiled.

The names used here are numba's own, without a promise to stay. Where they are missing kernels are loaded as numba does
it.
"""

from numba.core.caching import FunctionCache

try:
    from numba.core.runtime import rtsys
except ImportError:
    rtsys = None

_LOADS = rtsys is not None and hasattr(FunctionCache, "_load_overload")


class Kept(FunctionCache):
    """The disk cache of a kernel."""

    if _LOADS:

        def load_overload(self, sig, target_context):
            """Return the machine code for a signature, or None."""
            _leave_out_linear_algebra()
            # What kernels call to make arrays; numba's own way here is to refresh all of the context.
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)


def _leave_out_linear_algebra():
    """Let numba take for granted that scipy, without which the package is not installed, has linear algebra."""
    from numba.np import linalg

    linalg.ensure_blas = _is_there


def _is_there():
    pass
